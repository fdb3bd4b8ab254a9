// What frames cost here (`stipple study SCENE --calibrate`), and errors chosen by it (`--target-ms`, `--target-error`).
#pragma once

#include <span>
#include <string>

#include "apps/stipple/common.h"
#include "apps/study/calibration/curve.h"
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

/// Without samples: of a scene on this machine. The program's version counts, too.
study::Curve curveHere(uint64_t scene, const std::string& device, int threads);
/// Where it is kept.
std::string pathOf(const study::Curve& curve);
std::string nameOf(const render::Backend& backend);

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
