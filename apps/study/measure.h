// Frame times and the three errors of a mode, which are never merged: implementation (a backend against the fp64
// restatement of the same cut), level of detail (a cut against the same mode's leaves), reconstruction (a mode's leaves
// against rays traced against the same discs).
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/render/frame.h"

namespace stipple::study {

using StorePtr = std::shared_ptr<const lod::Store>;

/// Draws one store in any mode; what it holds stays resident.
class Drawer {
  public:
    Drawer(StorePtr store, std::unique_ptr<render::Backend> backend, Executor& executor);
    Drawer(const std::vector<render::PlacedStore>& placed, std::unique_ptr<render::Backend> backend,
           Executor& executor);
    Result<render::Image> draw(const lod::View& view, const render::FrameSettings& settings);
    /// Milliseconds of one more frame of what was drawn last; everything is resident.
    Result<double> again(const lod::View& view, const render::FrameSettings& settings);
    uint64_t recordsDrawn() const { return state_->counters.recordsDrawn; }
    double deliveredPixels() const { return state_->cut.tauEffective; }
    std::string backendName() const { return backend_->name(); }

  private:
    std::unique_ptr<render::Backend> backend_;
    std::unique_ptr<render::FrameState> state_;
};

/// All leaves.
constexpr double kLeaves = 1e-4;
render::FrameSettings settingsOf(render::Mode mode, double errorPixels, bool isLit);

struct FrameTime {
    double medianMs = 0;
    uint64_t records = 0;
    double fps() const { return 1e3 / medianMs; }
    double millionRecords() const { return static_cast<double>(records) / medianMs * 1e-3; }  ///< a second
};
/// Medians of `rounds` frames of each mode, the modes in turn: what else the machine does meets all of them alike.
Result<std::map<render::Mode, FrameTime>> timeModes(Drawer& drawer, const lod::View& view, double errorPixels,
                                                    bool isLit, int rounds);

/// dB are of pixels that either picture covers.
struct Errors {
    double implementation = 0, levelOfDetail = 0, reconstruction = 0;
    double overlap = 0;  ///< of the leaves' silhouette and the traced one (IoU)
};
struct ErrorTools {
    Drawer& drawer;
    Drawer& oracle;  ///< the fp64 restatement of the same store
    const render::Image& traced;
};
/// At a target of one pixel.
Result<Errors> measureErrors(const ErrorTools& tools, const lod::View& view, render::Mode mode, bool isLit);

/// Light as of a plain object: points of meshes have no light in their colours.
Result<render::Image> traceStore(const StorePtr& store, const lod::View& view, bool isLit, uint32_t samples,
                                 Executor& executor);

}  // namespace stipple::study
