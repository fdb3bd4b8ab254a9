// Where a surface of triangles goes on as points: the open edges of the triangles beside points.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::scene {

/// Places along the open edges (sides of one triangle only; corners at the same place are one) of triangles that lie
/// beside points, so close together that discs of the points' size at them leave no gap between both (Marroquim, Kraus
/// & Cavalcanti 2008, 5.2: border vertices carry radii).
struct BorderSample {
    size_t triangle = 0;
    glm::dvec3 weight{0};  ///< barycentric
};

/// `corners`: of each triangle, in the space of `points`. An edge is beside points where one lies within four times
/// their mean spacing (from the cells that they occupy: points of a surface).
std::vector<BorderSample> borderSamples(const std::vector<std::array<glm::dvec3, 3>>& corners,
                                        const std::vector<glm::dvec3>& points);

}  // namespace stipple::scene
