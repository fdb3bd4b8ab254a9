// What a small part of a mesh covers in a picture, seen from all sides in the mean.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::lod {

/// A direction of those all around, up to its sign, and its share of them. The axes of an icosahedron and of its dual:
/// with these weights polynomials of degree 9 are integrated exactly (McLaren 1963), so that it hardly matters how a
/// part lies.
struct CoverDirection {
    glm::dvec3 to;
    double share;
};
constexpr size_t kCoverDirections = 16;
const std::array<CoverDirection, kCoverDirections>& coverDirections();

/// Corners, and whether a triangle is drawn from both sides.
struct CoverTriangle {
    std::array<glm::dvec3, 3> corners;
    bool isTwoSided;
};

/// Mean over directions all around of what triangles cover together: what lies behind another counts once. Along rows
/// at right angles to `axis`, `rows` of them in each direction; where these are few, right in the mean over many parts.
double coverOf(const std::vector<CoverTriangle>& triangles, const glm::dvec3& axis, int rows);

}  // namespace stipple::lod
