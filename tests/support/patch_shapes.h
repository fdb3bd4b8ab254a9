// Surfaces for the tests of patches, as triangles and as points, and what patches look like as triangles.
#pragma once

#include <functional>

#include "lod/builder/patches/patch_build.h"
#include "tests/support/meshes.h"

namespace stipple::test {

/// place(u, v) for u, v in [0, 1] on a grid of so many cells each way; ends that meet are welded by their places.
lod::TriangleMesh sheet(uint32_t across, uint32_t along, const std::function<glm::dvec3(double, double)>& place);
lod::TriangleMesh torusMesh(uint32_t around, uint32_t across);
lod::TriangleMesh boxMesh(uint32_t cells);
/// The same triangles, vertices and triangles in another order, each from another corner.
lod::TriangleMesh shuffled(const lod::TriangleMesh& mesh, uint64_t seed);
lod::PointBlock shuffled(const lod::PointBlock& points, uint64_t seed);
std::vector<Triangle> trianglesOf(const lod::TriangleMesh& mesh);
/// Of all patches and gaps, in the source's units.
std::vector<Triangle> trianglesOf(const lod::PatchSet& set);
std::vector<Triangle> trianglesOf(const lod::Patch& patch, const glm::dvec3& middle);
/// Wavefront OBJ, one-sided.
void writeObj(const std::string& path, const lod::TriangleMesh& mesh);

lod::PatchSet patchesOf(const lod::TriangleMesh& mesh, const lod::PatchSettings& settings = {}, int threads = 2);
lod::PatchSet patchesOf(const lod::PointBlock& points, const lod::PatchSettings& settings = {}, int threads = 2);

}  // namespace stipple::test
