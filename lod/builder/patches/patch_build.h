// Elevation patches of what fits in memory, from a mesh or from points.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/progress.h"
#include "lod/primitives/mesh.h"
#include "lod/primitives/patch.h"
#include "lod/primitives/place_look.h"
#include "lod/primitives/point_material.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// How patches meet.
enum class PatchClosing : uint8_t {
    open,     ///< not at all: the control of tests
    overlap,  ///< each reaches beyond its border, over its neighbours
    gaps      ///< they end before it, and triangles between them fill the gaps
};

struct PatchSettings {
    double coneDegrees = 50;  ///< half the cone of a patch's normals
    PatchClosing closing = PatchClosing::overlap;
    uint64_t samples = 0;  ///< aimed at; 0: as many as there are points or vertices (of a mesh kFewestSamples at least)
    bool isTwoSided = false;      ///< points are seen from both sides (those without normals always are)
    PlaceLooks looks;             ///< of a mesh: colours and normals that are not of its vertices
    MapSettings maps;             ///< likewise; only a number of texels that is told counts
    bool hasFineNormals = false;  ///< of a mesh, some of which is a mirror
    std::function<bool()> isStopped;
};
constexpr uint64_t kFewestSamples = 20'000;

/// Is any so smooth, or clear, that its normals' rounding is seen in what it shows? (Of a grid most is nobody's.)
bool hasMirrors(const std::vector<PointMaterial>& list);

/// A sample of a patch.
struct PatchCorner {
    uint32_t patch = 0, sample = 0;
    auto operator<=>(const PatchCorner&) const = default;
};

/// Distances of one surface from another, scene units. `bound`: none is larger; `rms`: of samples.
struct PatchDistance {
    double bound = 0, rms = 0;
};

struct PatchSet {
    std::vector<Patch> patches;                    ///< places relative to `middle`
    std::vector<std::array<PatchCorner, 3>> gaps;  ///< triangles between patches
    uint64_t openEdges = 0;                        ///< of what gaps were to close, still with one triangle
    PointBlock left;                               ///< points that no patch stands for, relative to `middle`
    glm::dvec3 middle{0};
    bool isTwoSided = false;
    uint64_t pointsIn = 0, trianglesIn = 0;
    uint64_t samples = 0, triangles = 0;      ///< of patches; triangles with those in gaps
    uint64_t pointsLeft = 0;                  ///< points of the source, or vertices of triangles, among `left`
    std::map<std::string, uint64_t> dropped;  ///< of the source, by reason
    PatchDistance toSource, fromSource;

    /// One patch more, with its bounds.
    void add(Patch patch) {
        toSource.bound = std::max(toSource.bound, patch.errorToSource);
        fromSource.bound = std::max(fromSource.bound, patch.errorFromSource);
        samples += patch.samples();
        triangles += 2 * patch.drawnCells();
        patches.push_back(std::move(patch));
    }
};

/// The same bytes for any order of triangles and any number of threads. An empty result where it was stopped.
PatchSet patchesOfMesh(TriangleMesh mesh, const PatchSettings& settings, Executor& executor, Progress& progress);
/// Likewise of points; colours where `block.colour` is not empty.
PatchSet patchesOfPoints(PointBlock points, const PatchSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
