// Wind: nodes of plants are moved (wind.h); it has no pass and no table.
#include <algorithm>

#include "engine/render/draw_list.h"
#include "engine/render/effects/effect.h"

namespace stipple::render {

extern const Effect windEffect;
constinit const Effect windEffect{
    .name = "wind",
    .summary = "plants bend in gusts",
    .isRequested = [](const DrawSettings& s) { return s.wind.strength > 0; },
    .option = "--wind",
    .leaveOut = [](DrawSettings& s) { s.wind.strength = 0; },
    .ofScene =
        [](const EffectScene& scene) {
            return std::any_of(scene.instances.begin(), scene.instances.end(),
                               [&](const lod::Instance& i) { return mayBend(*scene.hierarchies[i.hierarchy], i); });
        },
    .ofFrame = [](const EffectFrame& frame) { return frame.nodes > 0; },
    .ofNode =
        [](const EffectNode& n) {
            return bendOf(n.settings.wind, n.hierarchy, n.instance, n.node, n.view, glm::normalize(n.settings.worldUp));
        },
    .tolerancePixels = kLeastSway,
    .toleranceSteps = 255};

}  // namespace stipple::render
