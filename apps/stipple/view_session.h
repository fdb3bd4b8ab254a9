// The scene that the window shows: its chunks, its colours, its axis. What fails leaves it as it was.
#pragma once

#include "apps/stipple/background_options.h"
#include "apps/stipple/calibration.h"
#include "apps/stipple/camera_options.h"
#include "apps/stipple/common.h"
#include "apps/stipple/effect_options.h"
#include "apps/stipple/legend.h"
#include "apps/stipple/mode_options.h"
#include "apps/stipple/sun_options.h"
#include "apps/stipple/view_keys.h"

namespace stipple::app {

struct ViewOptions {
    std::vector<std::string> inputs;
    std::string size = "1280x720", device = "auto", screenshot, resident = "1G", shade = "auto";
    double error = 1, wind = 0;
    uint64_t budget = 2'000'000;
    int frames = 0, accumulate = 64;
    bool force = false;
    TargetOptions target;
    ModeOptions drawn;
    CameraOptions camera;
    BuildOptions build;
    ColourOptions colour;
    EnvironmentOptions environment;
    BackgroundOptions background;
    SunOptions sun;
    MaterialOptions material;
    EffectOptions effects;
};

class ViewSession {
  public:
    ViewSession(const ViewOptions& options, render::Backend& backend, Executor& executor)
        : options_(options), backend_(backend), executor_(executor) {}
    /// Shows `scene` instead of what is shown, coloured by `colour`.
    Result<void> show(OpenedScene scene, const ColourOptions& colour, render::FrameSettings& settings);
    /// Own colours, height, normals, then every attribute, and round again. An error if none suits the scene.
    Result<void> nextColours(render::FrameSettings& settings);
    /// Another axis, for scenes whose files say otherwise than they are.
    void turnUp(render::FrameSettings& settings);

    const OpenedScene& scene() const { return scene_; }
    const Legend& legend() const { return legend_; }
    render::FrameState& state() { return *state_; }
    glm::dvec3 focus() const { return 0.5 * (scene_.description.focusMin + scene_.description.focusMax); }
    double diagonal() const;
    int upAxis() const;  ///< 0 to 2: the one nearest to up

  private:
    void restart(render::FrameSettings& settings);

    const ViewOptions& options_;
    render::Backend& backend_;
    Executor& executor_;
    OpenedScene scene_;
    int ownUpAxis_ = 2;
    lod::ColourBy colour_;
    ColourOptions shown_;  ///< what was asked for, that colour_ is
    Legend legend_;
    std::unique_ptr<render::FrameState> state_;
};

/// After own colours, height, normals, then every attribute.
std::vector<std::string> coloursAfter(const lod::ColourBy& now, const lod::StoreDescription& description);

}  // namespace stipple::app
