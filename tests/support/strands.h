// Strands for the tests: curls of known shape, and their stores.
#pragma once

#include "lod/builder/strands/strand_build.h"
#include "lod/primitives/strands.h"
#include "tests/support/support.h"

namespace stipple::test {

struct CurlRecipe {
    size_t count = 200, vertices = 60;
    uint64_t seed = 1;
    float radius = 0.01f;  ///< in the middle; ends taper to a third
    double twist = 4;      ///< radians along a ribbon
    double ribbons = 0.5;  ///< share of the strands
};

/// Helices at random places of a cube of edge 2 around the origin.
lod::StrandSet curls(const CurlRecipe& recipe);
/// One strand along the given places.
lod::StrandSet oneStrand(const std::vector<glm::dvec3>& places, float radius,
                         const std::vector<glm::vec3>& normals = {});

std::shared_ptr<const lod::Store> buildStrands(const lod::StrandSet& strands, const std::string& path,
                                               Executor& executor, uint32_t leafSegments = 256);

}  // namespace stipple::test
