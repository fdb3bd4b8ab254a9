// Where pictures are taken from: what every command that draws is told alike.
#pragma once

#include <optional>
#include <string>
#include <vector>
#include "apps/stipple/options.h"

#include "apps/stipple/common.h"

namespace stipple::app {

struct CameraOptions {
    std::string eye, target, cameraUp, path;
    double fov = 50;
    double ortho = 0;  ///< width that the picture shows, world units; 0: in perspective
    int sceneCamera = 0, orbit = 0;
    void addTo(CLI::App& app);
    /// What can be said before anything is opened.
    Result<void> check() const;
};

struct Shot {
    std::vector<lod::View> views;
    std::vector<double> seconds;  ///< of each view, from the first on; empty: one moment
    glm::dvec3 worldUp{0, 0, 1};
    std::string note;  ///< what a camera asks for that is not done
    std::optional<scene::CameraPath> path;
    /// View number `index`, so many seconds after its moment; before the path and after it the camera stands still.
    lod::View viewAfter(size_t index, double later) const;
};

/// The one camera that is asked for: by place, of the scene, or one that sees all of it.
Result<scene::Camera> makeCamera(const CameraOptions& o, const OpenedScene& opened, double aspect);
/// The camera path that is asked for, an orbit included; nothing if there is none.
Result<std::optional<scene::CameraPath>> makePath(const CameraOptions& o, const OpenedScene& opened, double aspect);
/// All views. `frames`: of a camera path; 1: as many as its duration and rate say.
Result<Shot> makeShot(const CameraOptions& o, int frames, const OpenedScene& opened, const glm::uvec2& size);

/// Adds `--up`: the scene's axis, wherever it is asked for.
void addUpOption(CLI::App& app, std::string& up);
/// A number from `low` to `high`; nan is none.
inline CLI::Validator numberBetween(double low, double high) { return within(low, high); }

}  // namespace stipple::app
