#include "apps/study/sweep/scene_drawer.h"

#include <algorithm>

#include "engine/render/accumulation.h"

namespace stipple::study {

SceneDrawer::SceneDrawer(const StudyScene& scene, std::unique_ptr<render::Backend> backend, Executor& executor,
                         uint64_t residentBytes)
    : backend_(std::move(backend)), draw_(scene.draw), executor_(executor) {
    streaming::StreamSettings streams;
    streams.residentBytes = residentBytes;
    state_ = render::makeFrameState(scene.placed, *backend_, executor, streams, scene.groups);
}

render::FrameSettings SceneDrawer::settings(render::Mode mode, double target, uint64_t records, bool wantDepth) const {
    render::FrameSettings s;
    s.mode = mode;
    s.budgets.errorPixels = target;
    s.budgets.records = records;
    s.draw = draw_;
    s.wantDepthAndNormal = wantDepth;
    return s;
}

Result<const render::Image*> SceneDrawer::draw(const lod::View& view, render::Mode mode, double target,
                                               uint64_t records) {
    STIPPLE_ASSIGN(const bool isComplete,
                   render::renderUntilComplete(*state_, view, settings(mode, target, records, true)));
    if (!isComplete)
        return fail(ErrorKind::budget, "a frame of the study does not fit", "--resident", "give more memory");
    return &state_->image;
}

Result<render::Image> SceneDrawer::drawFaded(const lod::View& view, render::Mode mode, double target, uint32_t frames) {
    STIPPLE_ASSIGN(const render::Image* middle, draw(view, mode, target));
    render::Image image = *middle;
    const auto frame = [&](const lod::View& seen, const render::FrameSettings& s) -> Result<void> {
        STIPPLE_TRY(render::renderUntilComplete(*state_, seen, s));
        image = state_->image;
        return {};
    };
    STIPPLE_TRY(render::expose(
        {frames, {}, 0, render::kFadeOctaves}, [&](double) { return view; }, settings(mode, target, kAllRecords, true),
        frame, image, executor_));
    return image;
}

Result<void> SceneDrawer::warm(const lod::View& view, render::Mode mode, double target, uint64_t records) {
    STIPPLE_ASSIGN(const bool isComplete,
                   render::renderUntilComplete(*state_, view, settings(mode, target, records, false)));
    if (!isComplete)
        return fail(ErrorKind::budget, "a frame of the study does not fit", "--resident", "give more memory");
    return {};
}

Result<void> SceneDrawer::again(const lod::View& view, render::Mode mode, double target, uint64_t records) {
    return render::renderResident(*state_, view, settings(mode, target, records, false));
}

Result<const render::Image*> SceneDrawer::drawArrived(const lod::View& view, render::Mode mode, double target) {
    STIPPLE_TRY(render::renderFrame(*state_, view, settings(mode, target, kAllRecords, false)));
    return &state_->image;
}

uint64_t SceneDrawer::cutBytes() const {
    std::vector<const lod::Store*> storeOf;
    for (const lod::Instance& instance : state_->instances) {
        storeOf.resize(std::max<size_t>(storeOf.size(), instance.source + 1));
        storeOf[instance.source] = state_->stores[instance.hierarchy].get();
    }
    uint64_t bytes = 0;
    std::vector<std::pair<uint32_t, uint32_t>> needed = state_->cut.keep;  // by each instance that does
    std::sort(needed.begin(), needed.end());
    needed.erase(std::unique(needed.begin(), needed.end()), needed.end());
    for (const auto& [source, chunk] : needed) bytes += lod::chunkPlace(storeOf[source]->hierarchy, chunk).bytes;
    return bytes;
}

}  // namespace stipple::study
