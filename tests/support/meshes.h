// Meshes for the tests: grown ones as stores, with their raw textures, and the cut of any of their nodes.
#pragma once

#include "apps/grow/meshes.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/store/store.h"
#include "tests/support/support.h"

namespace stipple::test {

struct MeshRecipe {
    grow::MeshOptions grow;
    bool isTextured = true, isTwoSided = false;
    glm::dmat4 place{1};
};

inline const lod::MeshSource::Tell tellNobody = [](uint64_t, uint64_t) { return Result<void>(); };
/// All that a source gives, as one.
lod::TriangleMesh collect(const lod::MeshSource& source);
lod::TriangleMesh growTriangles(const MeshRecipe& recipe, lod::MeshBuildSettings& settings);
std::shared_ptr<const lod::Store> growMeshStore(const MeshRecipe& recipe, const std::string& path, Executor& executor);

/// Three corners each, world space.
using Triangle = std::array<glm::dvec3, 3>;
glm::dvec3 closestPlace(const Triangle& triangle, const glm::dvec3& place);
/// All triangles of the input, as the store keeps them.
std::vector<Triangle> leafTriangles(const lod::Store& store);
/// The cut of one error everywhere: runs whose own error is at most `code`, in groups whose error is larger.
std::vector<lod::CutMeshDraw> evenCut(const lod::Hierarchy& h, uint32_t code);
/// Clusters that a cut draws.
std::vector<Triangle> drawnTriangles(const lod::Store& store, const std::vector<lod::CutMeshDraw>& draws);

/// Largest distance from points of `from` (corners and `samples` random points) to the surface `to`.
double largestDistance(const std::vector<Triangle>& from, const std::vector<Triangle>& to, size_t samples,
                       uint64_t seed);

}  // namespace stipple::test
