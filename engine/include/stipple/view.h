// Cameras, in the coordinates of the scene's files (fp64).
#pragma once

#include <stipple/namespace.h>

#include <array>

namespace stipple::v1 {

using Vec3 = std::array<double, 3>;

struct Camera {
    Vec3 eye{0, 0, 1}, target{0, 0, 0};
    Vec3 up{0, 1, 0};        ///< any length; not along the view
    double fovDegrees = 50;  ///< vertical
    /// Above 0: orthographic, and so much of the world is seen across the picture.
    double orthoWidth = 0;
};

}  // namespace stipple::v1
