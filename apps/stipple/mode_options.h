// How points become a picture, on the command line, and the options that only some of the modes use.
#pragma once

#include <string>

#include "engine/base/result.h"
#include "engine/render/frame.h"
#include "engine/render/reconstructions/table.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

struct ModeOptions {
    std::string mode = render::reconstructions().front().name, normalise = "pixel";
    std::string patchAs = "auto", interpolate = "correct";
    std::string refract = "object";
    std::string hidden = "skip";
    double opacity = 1;
    double lowPass = 0.5;  ///< variance of the pixel's Gaussian, px^2
    double kernel = 2;     ///< standard deviations

    /// `hasReference`: the traced full detail is one of them.
    void addTo(CLI::App& sub, bool hasReference);
    /// Where it is the user's choice: the window is quick while something moves, exact at rest.
    void addNormaliseTo(CLI::App& sub);
    void applyTo(render::FrameSettings& settings) const;
    /// Says of placed stores what applyTo says of frames.
    void applyTo(std::vector<render::PlacedStore>& placed) const;
};

/// Refuses what was asked for and would be ignored: an option that mode `mode` does not use.
Result<void> checkOfMode(const CLI::App& sub, const std::string& mode);

}  // namespace stipple::app
