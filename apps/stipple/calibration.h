// What frames cost here (`stipple study SCENE --calibrate`), and errors chosen by it (`--target-ms`, `--target-error`).
#pragma once

#include <functional>
#include <span>
#include <string>

#include "apps/stipple/common.h"
#include "apps/study/sweep/plan.h"
#include "engine/render/frame.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

struct TargetOptions {
    double error = 0, ms = 0;  ///< px; 0: not asked for
    bool isAny() const { return error > 0 || ms > 0; }
    /// After --error, of which they take the place.
    void addTo(CLI::App& sub);
};

/// Of the content of all stores and where they stand.
uint64_t sceneHash(const OpenedScene& opened);

/// Measures and keeps; prints a table, or JSON.
Result<void> calibrate(const study::StudyScene& scene, const study::StudySettings& settings,
                       std::unique_ptr<render::Backend> backend, Executor& executor, bool isJson,
                       const std::function<Result<void>(uint64_t done, uint64_t total)>& say);

/// What views have to do once everything is there.
struct CutLoads {
    const render::FrameState& state;
    lod::Budgets budgets;
    std::span<const lod::View> views;
};
struct Chosen {
    double errorPixels = 0, ms = 0;
    std::string text;  ///< what was chosen, and what it costs
};
/// A function of scene, views and the calibration alone. Error (input): there is none of this scene and mode on this
/// device; (budget): no error is coarse enough.
Result<Chosen> chooseError(const TargetOptions& target, const CutLoads& loads, const std::string& mode, uint64_t scene,
                           const Executor& executor);

}  // namespace stipple::app
