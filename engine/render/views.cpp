#include "engine/render/views.h"

#include <utility>

#include "engine/base/process.h"

namespace stipple::render {

Result<void> renderViews(FrameState& state, std::span<const lod::ViewRequest> views, const FrameSettings& settings,
                         ViewsFrame& frame) {
    const double start = nowSeconds();
    streaming::Streamer& streamer = *state.streamer;
    streamer.collect();
    streamer.upload();
    const double cutStart = nowSeconds();
    lod::selectCuts(state.scene(), streamer.residency(), views, settings.budgets.records, frame.scratch, frame.cut);
    const double cutMs = (nowSeconds() - cutStart) * 1e3;
    streamer.request(frame.cut.merged);
    frame.images.resize(views.size());
    for (size_t v = 0; v < views.size(); ++v) {
        std::swap(state.cut, frame.cut.views[v]);
        std::swap(state.image, frame.images[v]);
        const Result<void> drawn = drawCut(state, views[v].view, settings, start, cutMs);
        std::swap(state.cut, frame.cut.views[v]);
        std::swap(state.image, frame.images[v]);
        STIPPLE_TRY(drawn);
    }
    return {};
}

}  // namespace stipple::render
