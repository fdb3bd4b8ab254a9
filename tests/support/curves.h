// Curves for the tests: curls of known shape, and their stores.
#pragma once

#include "lod/builder/curves/curve_build.h"
#include "lod/primitives/curves.h"
#include "tests/support/support.h"

namespace stipple::test {

struct CurlRecipe {
    size_t count = 200, vertices = 60;
    uint64_t seed = 1;
    float radius = 0.01f;  ///< in the middle; ends taper to a third
    double twist = 4;      ///< radians along a ribbon
    double ribbons = 0.5;  ///< share of the curves
};

/// Helices at random places of a cube of edge 2 around the origin.
lod::CurveSet curls(const CurlRecipe& recipe);
/// One curve along the given places.
lod::CurveSet oneCurve(const std::vector<glm::dvec3>& places, float radius, const std::vector<glm::vec3>& normals = {});

std::shared_ptr<const lod::Store> buildCurves(const lod::CurveSet& curves, const std::string& path, Executor& executor,
                                              uint32_t leafSegments = 256);

}  // namespace stipple::test
