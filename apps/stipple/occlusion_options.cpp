#include "apps/stipple/occlusion_options.h"

#include <cmath>

#include "apps/stipple/options.h"

namespace stipple::app {

void OcclusionOptions::addTo(CLI::App& sub) {
    auto* const length =
        sub.add_option("--occlusion-radius", radius,
                       "of ambient occlusion: how far away things take light from each other, world units (default: a "
                       "50th of the scene's extent)")
            ->transform(positive())
            ->type_name("LENGTH");
    auto* const detail =
        sub.add_option("--occlusion-resolution", resolution,
                       "of ambient occlusion: full (every pixel), or half (every second one both ways; quicker)")
            ->check(oneOf({"half", "full"}))
            ->capture_default_str();
    for (const char* name : {"--effect", "--effects"})
        if (auto* const effects = sub.get_option_no_throw(name))
            for (auto* const option : {length, detail}) option->needs(effects);
}

render::Occlusion OcclusionOptions::of(const lod::StoreDescription& scene) const {
    constexpr double kShare = 0.02;
    // (A single point has no extent.)
    const double extent = glm::length(scene.focusMax - scene.focusMin);
    const double own = extent > 0 && std::isfinite(extent) ? kShare * extent : 1;
    return {radius > 0 ? radius : own, resolution == "full"};
}

}  // namespace stipple::app
