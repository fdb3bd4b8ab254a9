// What the window draws over the picture, by Dear ImGui calls. Nothing of it takes the mouse.
#pragma once

#include <string>
#include <vector>

#include "apps/stipple/legend.h"
#include "apps/stipple/view_keys.h"
#include "apps/stipple/view_pace.h"

namespace stipple::app {

struct OverlayFacts {
    const render::FrameState& state;
    const ViewSettings& settings;
    const Legend& legend;
    const Notices& notices;
    std::string opening;                        ///< of what is being opened; empty: nothing is
    const char* hands = "";                     ///< "orbit", "fly" or what moves the camera
    double windowMs = 0;                        ///< of the last frame, with showing it
    uint32_t accumulated = 0, accumulates = 1;  ///< frames whose mean is shown at rest, and how many it may be
    std::array<char, gpu::kSteerCount> keyNames{};
};
/// What a frame takes. Where its picture stays on the device, handing it in takes less than drawing it, which is known
/// of one or two frames before.
double frameMsOf(const render::FrameState& state);

void drawOverlay(const OverlayFacts& facts);

}  // namespace stipple::app
