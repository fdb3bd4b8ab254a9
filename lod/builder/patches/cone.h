// The narrowest cone about normals, from the smallest ball about their tips (Gaertner 1999; Ochotta & Hiller
// 2006, 3.1).
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace stipple::lod {

struct NormalCone {
    glm::dvec3 axis{0, 0, 1};
    /// Of the half angle. That of 90 degrees and more is not told apart: -1, without an axis.
    double cosine = 1;
    std::array<glm::dvec3, 4> support{};  ///< normals on its rim
    uint32_t supports = 0;
};

/// The smallest cone of normals (unit) `normal[i]`, i in `of`. It may stop as soon as the cosine is below `least`: then
/// the cosine is one below that, but not the one asked for.
NormalCone coneOf(std::span<const glm::vec3> normal, std::span<const uint32_t> of, double least = -1);
/// Of a few unit vectors.
NormalCone coneOf(std::span<const glm::dvec3> normals);
/// May both fit into one cone of that cosine? False only where they cannot. `both`: a cone about both, its cosine not
/// the best there is: at least `leastCosine`, and they surely fit.
bool mayFit(const NormalCone& a, const NormalCone& b, double leastCosine, NormalCone& both);

}  // namespace stipple::lod
