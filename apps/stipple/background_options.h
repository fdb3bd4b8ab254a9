// What is behind the scene, on the command line: a colour, or the environment's picture.
#pragma once

#include <string>

#include "apps/stipple/common.h"
#include "apps/stipple/options.h"
#include "engine/render/draw_list.h"

namespace stipple::app {

struct BackgroundOptions {
    std::string what;  ///< R,G,B or environment

    BackgroundOptions();
    CLI::Option* addTo(CLI::App& app);
    bool isEnvironment() const { return what == "environment"; }
    /// Refuses what cannot be meant.
    Result<void> check(const EnvironmentOptions& environment) const;
    /// After check; reads the picture where it is asked for.
    Result<void> applyTo(render::DrawSettings& settings, const EnvironmentOptions& environment, uint64_t memoryBytes,
                         Executor& executor) const;
};

}  // namespace stipple::app
