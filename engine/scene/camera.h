// Cameras in file coordinates (fp64), and paths of them.
#pragma once

#include <string>
#include <vector>

#include "engine/base/result.h"
#include "lod/cut.h"
#include "lod/primitives.h"

namespace stipple::scene {

struct Camera {
    glm::dvec3 eye{0, 0, 1}, target{0}, up{0, 1, 0};
    double fovDegrees = 50;  ///< vertical
};

/// A key of a camera path.
struct CameraKey {
    double t = 0;  ///< seconds
    Camera camera;
};
struct CameraPath {
    double fps = 30;
    std::vector<CameraKey> keys;
    /// Catmull-Rom through the keys; clamped at the ends.
    Camera at(double t) const;
    double duration() const { return keys.empty() ? 0 : keys.back().t - keys.front().t; }
};

/// A camera that sees the whole box from a three-quarter view.
Camera fitCamera(const glm::dvec3& boundsMin, const glm::dvec3& boundsMax, const glm::dvec3& up, double aspect);

/// The view of `camera` at width x height pixels. `nearPlane` world units.
lod::View makeView(const Camera& camera, uint32_t width, uint32_t height, double nearPlane);

/// Reads {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [...], "up": [...], "fov": 50}]}.
Result<CameraPath> readCameraPath(const std::string& path);
/// An orbit around the box: what a headless ./run renders.
CameraPath makeOrbit(const glm::dvec3& boundsMin, const glm::dvec3& boundsMax, const glm::dvec3& up, double aspect,
                     int keys);

}  // namespace stipple::scene
