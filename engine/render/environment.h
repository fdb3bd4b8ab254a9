// An HDR picture (equirectangular, y up) as light: the tables of shaders/shared/environment.h.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "engine/base/executor.h"

namespace stipple::render {

/// Linear RGB, top row first; the middle of the picture is -z, as in glTF viewers.
struct HdrImage {
    uint32_t width = 0, height = 0;
    std::vector<float> rgb;
};

/// The picture's axes in the world: its y is up, its x the world's (where that is up: the world's z) without its part
/// along up.
glm::dmat3 environmentAxes(const glm::dvec3& worldUp);

struct Environment {
    std::vector<float> table;  ///< kEnvironmentFloats, and the sharp maps where there are any
    uint32_t sharpEdge = 0;    ///< texels across the sharpest; 0: there are none
};

/// Below this roughness the sharp maps are seen.
inline constexpr float kMirrorRoughness = 0.25f;

/// `scale` multiplies the picture. Mirror levels are cosine lobes as wide as the roughness' (a power of two as
/// exponent); the sharpest is 128 texels across the octahedron (1.6 degrees a texel), so perfect mirrors are blurred,
/// unless `hasMirrors`: then maps of up to 2048 texels across (at most 0.17 degrees a texel; a cube of 640^2 a face has
/// 0.18), 67 MB of them, are seen by what is smoother than kMirrorRoughness.
Environment makeEnvironment(const HdrImage& image, float scale, Executor& executor, bool hasMirrors = false);

}  // namespace stipple::render
