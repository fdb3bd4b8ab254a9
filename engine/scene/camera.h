// Cameras in file coordinates (fp64), and paths of them.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "lod/cut/cut.h"
#include "lod/primitives/primitives.h"

namespace stipple::scene {

struct Camera {
    glm::dvec3 eye{0, 0, 1}, target{0}, up{0, 1, 0};
    double fovDegrees = 50;  ///< vertical
    /// Orthographic, if either is above 0: at least so much of the world is seen across and along the picture.
    double orthoWidth = 0, orthoHeight = 0;
    /// Orthographic: what is nearer to the eye than this is cut off; what is farther than that should be (0: nothing).
    double orthoNear = 0, orthoFar = 0;
    bool isOrthographic() const { return orthoWidth > 0 || orthoHeight > 0; }
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

/// Share of the picture's tighter side that a scene spans when a camera is fitted to it.
inline constexpr double kFitShare = 0.88;

/// A camera that sees all of `points` (at least one) from a three-quarter view, flat scenes from steeper above: their
/// projection spans kFitShare of the picture's tighter side and stands in its middle.
Camera fitCamera(std::span<const glm::dvec3> points, const glm::dvec3& up, double aspect, double fovDegrees = 50);
/// `perspective` as an orthographic camera from the same side: the scene's projection is in the middle of the picture
/// and nothing of `points` is behind the eye.
Camera fitOrthographic(const Camera& perspective, std::span<const glm::dvec3> points, double width);
/// Of a box.
Camera fitCamera(const glm::dvec3& boundsMin, const glm::dvec3& boundsMax, const glm::dvec3& up, double aspect,
                 double fovDegrees = 50);
/// The corners of a box.
std::array<glm::dvec3, 8> cornersOf(const glm::dvec3& boundsMin, const glm::dvec3& boundsMax);

/// The view of `camera` at width x height pixels. `nearPlane` world units.
lod::View makeView(const Camera& camera, uint32_t width, uint32_t height, double nearPlane);

/// Reads {"fps": 30, "keys": [{"t": 0, "eye": [x,y,z], "target": [...], "up": [...], "fov": 50}]}; with "ortho", the
/// width that the picture shows, instead of "fov" in all keys, the path is orthographic. `up`: of keys that do not say.
Result<CameraPath> readCameraPath(const std::string& path, const glm::dvec3& up = {0, 1, 0});
/// An orbit around points, at one distance and height: what a headless ./run renders. Nothing of them is ever outside.
CameraPath makeOrbit(std::span<const glm::dvec3> points, const glm::dvec3& up, double aspect, int keys,
                     double fovDegrees = 50);

}  // namespace stipple::scene
