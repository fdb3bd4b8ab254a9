// An HDR picture (equirectangular, y up) as light: the tables of shaders/shared/environment.h.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/executor.h"

namespace stipple::render {

/// Linear RGB, top row first; the middle of the picture is -z, as in glTF viewers.
struct HdrImage {
    uint32_t width = 0, height = 0;
    std::vector<float> rgb;
};

struct Environment {
    std::vector<float> table;  ///< kEnvironmentFloats
};

/// `scale` multiplies the picture. Mirror levels are cosine lobes as wide as the roughness' (a power of two as
/// exponent); the sharpest is 128 texels across the octahedron, so perfect mirrors are slightly blurred.
Environment makeEnvironment(const HdrImage& image, float scale, Executor& executor);

}  // namespace stipple::render
