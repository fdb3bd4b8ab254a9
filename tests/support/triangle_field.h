// How far a place is from the nearest of many triangles, in fp64.
#pragma once

#include "apps/study/audit/nearest_field.h"
#include "tests/support/meshes.h"

namespace stipple::test {

struct OfTriangles {
    using Item = Triangle;
    static void grow(const Triangle& t, glm::dvec3& lo, glm::dvec3& hi) {
        for (const glm::dvec3& corner : t) {
            lo = glm::min(lo, corner);
            hi = glm::max(hi, corner);
        }
    }
    static double along(const Triangle& t, int axis) { return t[0][axis] + t[1][axis] + t[2][axis]; }
    static double distance(const Triangle& t, const glm::dvec3& place) {
        return glm::length(place - closestPlace(t, place));
    }
};
using TriangleField = study::NearestField<OfTriangles>;

}  // namespace stipple::test
