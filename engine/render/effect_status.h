// What became of each effect in the last frame: the overlay and --json say it, tests count with it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine/render/frame.h"

namespace stipple::render {

struct EffectStatus {
    std::string name;
    bool isRequested = false;  ///< and the scene could show it
    std::string calledForBy;   ///< who requested it, for a person; empty: nobody
    bool isActive = false;     ///< the frame has it
    uint64_t passes = 0;       ///< of its own, recorded in the frame
    EffectResources held;
    /// Of its passes. None where they run together with others, tile by tile: then `within` is what these are called.
    std::optional<double> ms;
    std::string within;
    double msBefore = 0;  ///< of the frames that it draws before that of the camera
};

/// Of all effects of the table, after a frame of `state` with these settings.
std::vector<EffectStatus> effectStatus(const FrameState& state, const DrawSettings& settings);

}  // namespace stipple::render
