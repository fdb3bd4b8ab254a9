// The effects: a new one is a file of this folder with its manifest, and a line of the table (README.md).
#pragma once

#include <optional>
#include <string_view>

#include "engine/render/effects/effect.h"

namespace stipple::render {

/// In the order in which they are asked, and in which those of one stage run.
std::span<const Effect* const> effects();
/// Null where there is none of that name.
const Effect* effectNamed(std::string_view name);
/// The place of the effect that a pass is of; none: every frame may have the pass.
std::optional<size_t> effectOfPass(Pass pass);

/// Those that a scene could show; without a scene: all.
EffectSet effectsOfScene(const EffectScene& scene);
EffectSet allEffects();
/// Those of `scene` that the settings ask for.
EffectSet requestedEffects(EffectSet scene, const DrawSettings& settings);
/// Is the effect of that name asked for, in whatever scene? False where there is none.
bool isRequested(std::string_view name, const DrawSettings& settings);
/// Those of `requested` that a frame shows. `nodes`: how many feed each effect of the table.
EffectSet effectsOfFrame(EffectSet requested, const FrameContent& content, const DrawSettings& settings,
                         const DrawList& draws, std::span<const uint64_t> nodes);

}  // namespace stipple::render
