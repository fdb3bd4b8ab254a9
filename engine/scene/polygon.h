// Polygons of many corners to triangles.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::scene {

/// Corners of the n - 2 triangles of a polygon, which need not be convex or quite flat. One that crosses itself gets
/// some triangles.
std::vector<std::array<uint32_t, 3>> triangulatePolygon(const std::vector<glm::dvec3>& corners);

}  // namespace stipple::scene
