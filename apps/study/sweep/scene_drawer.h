// A scene with a backend of its own, whose frames are drawn with what they want, and timed once it is there.
#pragma once

#include <memory>

#include "apps/study/sweep/plan.h"

namespace stipple::study {

class SceneDrawer {
  public:
    SceneDrawer(const StudyScene& scene, std::unique_ptr<render::Backend> backend, Executor& executor,
                uint64_t residentBytes);
    /// Complete, with depth and normals. Error (budget): it does not fit.
    Result<const render::Image*> draw(const lod::View& view, render::Mode mode, double target,
                                      uint64_t records = kAllRecords);
    /// The mean of so many frames, over which levels of detail fade as in films (render::kFadeOctaves).
    Result<render::Image> drawFaded(const lod::View& view, render::Mode mode, double target, uint32_t frames);
    /// Brings what the frame wants, and draws it once, without depth and normals.
    Result<void> warm(const lod::View& view, render::Mode mode, double target, uint64_t records = kAllRecords);
    /// The same frame again: milliseconds are in counters(), those of passes in passes().
    Result<void> again(const lod::View& view, render::Mode mode, double target, uint64_t records = kAllRecords);
    /// What there is by now, and asks for what is missing (render::renderFrame).
    Result<const render::Image*> drawArrived(const lod::View& view, render::Mode mode, double target);
    /// Of the scene; those of the frames that follow.
    const render::DrawSettings& drawSettings() const { return draw_; }
    void setDrawSettings(render::DrawSettings draw) { draw_ = std::move(draw); }
    /// Of the last frame.
    const render::FrameState& state() const { return *state_; }
    const FrameCounters& counters() const { return state_->counters; }
    const std::vector<render::PassTime>& passes() const { return backend_->passTimes(); }
    /// Of the chunks that the last cut needs, as they lie in their files.
    uint64_t cutBytes() const;
    std::string device() const { return backend_->name() + ", " + backend_->device(); }

  private:
    render::FrameSettings settings(render::Mode mode, double target, uint64_t records, bool wantDepth) const;
    std::unique_ptr<render::Backend> backend_;
    std::unique_ptr<render::FrameState> state_;
    render::DrawSettings draw_;
    Executor& executor_;
};

}  // namespace stipple::study
