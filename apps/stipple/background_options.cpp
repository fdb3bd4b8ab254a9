#include "apps/stipple/background_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "engine/scene/open/open_scene.h"
#include "shaders/shared/record.h"

namespace stipple::app {
namespace {

Result<glm::dvec3> colourOf(const std::string& what) {
    STIPPLE_ASSIGN(const glm::dvec3 colour, parseVector(what, "--background"));
    for (int c = 0; c < 3; ++c)
        if (!(colour[c] >= 0 && colour[c] <= 255))
            return fail(ErrorKind::usage, "channels are 0 to 255", "--background");
    return colour;
}

}  // namespace

BackgroundOptions::BackgroundOptions() : what(fmt::format("{}", fmt::join(render::kBackground, ","))) {}

CLI::Option* BackgroundOptions::addTo(CLI::App& app) {
    return app
        .add_option("--background", what,
                    "what is behind the scene: a colour, sRGB, 0 to 255 each, or environment (the picture of "
                    "--environment)")
        ->type_name("R,G,B|environment")
        ->capture_default_str();
}

Result<void> BackgroundOptions::check(const EnvironmentOptions& environment) const {
    if (!isEnvironment()) {
        STIPPLE_TRY(colourOf(what));
    } else if (environment.path.empty()) {
        return fail(ErrorKind::usage, "is the picture of --environment, which is not given", "--background environment",
                    "give both");
    }
    return {};
}

Result<void> BackgroundOptions::applyTo(render::DrawSettings& settings, const EnvironmentOptions& environment,
                                        uint64_t memoryBytes, Executor& executor) const {
    if (isEnvironment()) {
        STIPPLE_ASSIGN(settings.backdrop,
                       scene::openBackdrop(environment.path, environment.scale, memoryBytes, executor));
        return {};
    }
    STIPPLE_ASSIGN(const glm::dvec3 colour, colourOf(what));
    for (int c = 0; c < 3; ++c) settings.background[c] = shared::linearFromSrgb(static_cast<float>(colour[c]) / 255.0f);
    return {};
}

}  // namespace stipple::app
