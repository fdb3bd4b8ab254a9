// The pass table of a frame: a pure function of what it draws, of its reconstruction and of its effects.
#pragma once

#include <vector>

#include "engine/render/content.h"
#include "engine/render/effects/effect.h"
#include "engine/render/reconstructions/table.h"

namespace stipple::render {

/// In order; a pass that the frame does not call for is not in the list.
std::vector<Pass> passesOf(Mode mode, const FrameContent& content, EffectSet effects);

/// Of a frame that is what a light sees: depths, and what lets light through. Discs of points are closed.
inline constexpr Mode kCasterMode = Mode::splat;
std::vector<Pass> passesOfCasters(const FrameContent& content);

}  // namespace stipple::render
