// The pass table of a frame: a pure function of what it draws, of its reconstruction and of its effects.
#pragma once

#include <vector>

#include "engine/render/content.h"
#include "engine/render/effects/effect.h"
#include "engine/render/reconstructions/table.h"

namespace stipple::render {

/// In order; a pass that the frame does not call for is not in the list.
std::vector<Pass> passesOf(Mode mode, const FrameContent& content, EffectSet effects);

}  // namespace stipple::render
