// What stands in for the papers' models: meshes as so many surfels, and what is made by formulas.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/render/frame.h"
#include "engine/scene/scene.h"
#include "engine/scene/surfels.h"
#include "lod/primitives/mesh.h"
#include "lod/store/store.h"

namespace stipple::study {

/// A surface to be sampled. `area`: of its triangles, world units squared.
struct Surface {
    std::string path;
    scene::Scene scene;
    std::vector<scene::DecodedImage> images;
    double area = 0;
};
/// .ply with faces, .obj, .glb; of NAME.gz what is packed, which goes to `folder`.
Result<Surface> readSurface(const std::string& path, const std::string& folder);

/// About `count` samples with their normals, seen from their fronts. Built once: a store that is at `path` is taken.
Result<std::shared_ptr<const lod::Store>> surfelStore(const Surface& surface, uint64_t count, const std::string& path,
                                                      Executor& executor);
/// All of its triangles, in its own units.
lod::TriangleMesh meshOf(const Surface& surface);
/// The triangles of the surface themselves.
Result<std::shared_ptr<const lod::Store>> triangleStore(const Surface& surface, const std::string& path,
                                                        Executor& executor);

/// Elevation patches of them.
Result<std::shared_ptr<const lod::Store>> patchStore(const Surface& surface, const std::string& path,
                                                     Executor& executor);

/// A scan as it is.
Result<std::shared_ptr<const lod::Store>> scanStore(const std::string& file, const std::string& path,
                                                    Executor& executor);

/// A square of side 2 in the plane z = 0: `side`^2 points, of which cells of `cell` points are black and white in turn.
lod::PointBlock checkerPlane(uint32_t side, uint32_t cell);
/// About `count` points on the unit sphere, evenly (Fibonacci).
lod::PointBlock unitSphere(uint64_t count);
Result<std::shared_ptr<const lod::Store>> pointStore(lod::PointBlock points, const std::string& path,
                                                     Executor& executor);

/// From three quarters, all in the picture.
lod::View fittedView(const lod::Store& store, uint32_t width, uint32_t height);
/// From `eye` towards `target`, 50 degrees across the height.
lod::View viewFrom(const glm::dvec3& eye, const glm::dvec3& target, const glm::dvec3& up, uint32_t width,
                   uint32_t height);

}  // namespace stipple::study
