// Several views of one scene in one frame (lod/cut/views.h): two eyes, or a camera and the lights that cast shadows.
// What is resident, and the budgets, are theirs together.
#pragma once

#include <span>
#include <vector>

#include "engine/render/frame.h"
#include "lod/cut/views.h"

namespace stipple::render {

/// Reused between frames of one state.
struct ViewsFrame {
    lod::ViewsScratch scratch;
    lod::CutOfViews cut;
    std::vector<Image> images;  ///< in the order of the requests
};

/// As renderFrame, of several views: what arrived is taken in once, and what they miss is asked for once. Accuracy is
/// that of each request, records are those of all of them together; the other settings hold for each. The counters of
/// `state` are those of the last view, and of streaming.
Result<void> renderViews(FrameState& state, std::span<const lod::ViewRequest> views, const FrameSettings& settings,
                         ViewsFrame& frame);

/// Draws state.cut, which is of `view`, into state.image. From `start` on (seconds) it counts as time of the frame, of
/// which the cut took `cutMs`.
Result<void> drawCut(FrameState& state, const lod::View& view, const FrameSettings& settings, double start,
                     double cutMs);

}  // namespace stipple::render
