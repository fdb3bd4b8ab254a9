// Transparency: bodies that what is behind shows through are layers (layers.h), put over it by their alpha; it has no
// pass and no table. Only frames of such layers have it.
#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"

namespace stipple::render {

extern const Effect transparencyEffect;
constinit const Effect transparencyEffect{
    .name = "transparency",
    .summary = "materials that are transparent (glTF BLEND) and --opacity: what is behind shows through",
    .isRequested =
        [](const DrawSettings& s) {
            const bool isAsked = s.opacity < 1 || s.parameters.facts.hasTransparent;
            return s.isBlended || (s.transparency && isAsked);
        },
    .option = "--opacity, or a material",
    .leaveOut =
        [](DrawSettings& s) {
            s.transparency = false;
            s.opacity = 1;
        },
    .ofScene = [](const EffectScene& scene) { return !scene.instances.empty(); },
    .ofFrame = [](const EffectFrame& frame) { return frame.settings.isBlended && !frame.content.isEmpty(); },
    .ofNode = nullptr,
    .fill = nullptr,
    .stage = Stage::surface,
    .tolerancePixels = 0,
    .toleranceSteps = 0};

}  // namespace stipple::render
