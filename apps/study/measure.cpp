#include "apps/study/measure.h"

#include <algorithm>

#include "engine/base/process.h"
#include "engine/reference/reference.h"

namespace stipple::study {

Drawer::Drawer(StorePtr store, std::unique_ptr<render::Backend> backend, Executor& executor)
    : backend_(std::move(backend)),
      state_(render::makeFrameState(std::vector<StorePtr>{std::move(store)}, *backend_, executor, {})) {}

Drawer::Drawer(const std::vector<render::PlacedStore>& placed, std::unique_ptr<render::Backend> backend,
               Executor& executor)
    : backend_(std::move(backend)), state_(render::makeFrameState(placed, *backend_, executor, {})) {}

Result<render::Image> Drawer::draw(const lod::View& view, const render::FrameSettings& settings) {
    STIPPLE_ASSIGN(const bool isComplete, render::renderUntilComplete(*state_, view, settings));
    if (!isComplete) return fail(ErrorKind::budget, "the model does not fit into the memory for what is drawn");
    return state_->image;
}

Result<double> Drawer::again(const lod::View& view, const render::FrameSettings& settings) {
    const double start = nowSeconds();
    STIPPLE_TRY(render::renderResident(*state_, view, settings));
    return (nowSeconds() - start) * 1e3;
}

render::FrameSettings settingsOf(render::Mode mode, double errorPixels, bool isLit) {
    render::FrameSettings s;
    s.mode = mode;
    s.budgets.errorPixels = errorPixels;
    s.draw.lit = isLit;
    s.wantDepthAndNormal = true;
    return s;
}

Result<std::map<render::Mode, FrameTime>> timeModes(Drawer& drawer, const lod::View& view, double errorPixels,
                                                    bool isLit, int rounds) {
    std::map<render::Mode, std::vector<double>> times;
    std::map<render::Mode, FrameTime> out;
    for (int round = -1; round < rounds; ++round)
        for (const render::Reconstruction& r : render::reconstructions()) {
            render::FrameSettings settings = settingsOf(r.mode, errorPixels, isLit);
            settings.wantDepthAndNormal = false;
            if (round < 0) {  // what is missing comes, and memory grows
                STIPPLE_TRY(drawer.draw(view, settings));
                out[r.mode].records = drawer.recordsDrawn();
                continue;
            }
            STIPPLE_ASSIGN(const double ms, drawer.again(view, settings));
            times[r.mode].push_back(ms);
        }
    for (auto& [mode, list] : times) {
        std::sort(list.begin(), list.end());
        out[mode].medianMs = list[list.size() / 2];
    }
    return out;
}

Result<Errors> measureErrors(const ErrorTools& tools, const lod::View& view, render::Mode mode, bool isLit) {
    STIPPLE_ASSIGN(const render::Image cut, tools.drawer.draw(view, settingsOf(mode, 1, isLit)));
    STIPPLE_ASSIGN(const render::Image restated, tools.oracle.draw(view, settingsOf(mode, 1, isLit)));
    STIPPLE_ASSIGN(const render::Image leaves, tools.drawer.draw(view, settingsOf(mode, kLeaves, isLit)));
    STIPPLE_ASSIGN(const auto implementation, reference::compareImages(cut, restated, 4, nullptr));
    STIPPLE_ASSIGN(const auto detail, reference::compareImages(cut, leaves, 4, nullptr));
    STIPPLE_ASSIGN(const auto reconstruction, reference::compareImages(leaves, tools.traced, 4, nullptr));
    return Errors{implementation.foregroundPsnr, detail.foregroundPsnr, reconstruction.foregroundPsnr,
                  reconstruction.silhouetteIou};
}

Result<render::Image> traceStore(const StorePtr& store, const lod::View& view, bool isLit, uint32_t samples,
                                 Executor& executor) {
    render::PlacedStore placed;
    placed.store = store;
    reference::TraceSettings settings;
    settings.samplesPerAxis = samples;
    settings.draw.lit = isLit;
    return reference::trace({placed}, view, settings, executor);
}

}  // namespace stipple::study
