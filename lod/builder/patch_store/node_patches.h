// One node: its triangles, and those around it, to patches on the grid of its level.
#pragma once

#include "lod/builder/octree/frame.h"
#include "lod/builder/patch_store/discs.h"
#include "lod/builder/patch_store/level_looks.h"
#include "lod/builder/patch_store/level_mesh.h"
#include "lod/builder/patches/patch_build.h"

namespace stipple::lod {

/// Cells of the grid along an edge of a node's cell.
constexpr uint32_t kPatchCells = 64;
/// How far a node's patches reach beyond its cell, cells of its grid: 1.5 of the next coarser level. Up to there they
/// are made of what is around the node as of what is in it; they go on over what is around, that far, at most.
constexpr double kPatchReach = 3, kPatchAround = 8;

inline double patchStep(const Frame& frame, uint32_t level) { return frame.cellSize(level) / kPatchCells; }

/// Triangles beside a node, by how far their middles are from its cell.
struct AroundNode {
    Soup within, beyond;      ///< kPatchReach, kPatchAround
    double surfaceError = 0;  ///< of those: bound of the distance from the source, lattice units
    /// `lo`: corner of the node's cell; `error`: of all of `from`.
    void add(const Soup& from, double error, const glm::dvec3& lo, double cell);
};

struct NodePatches {
    std::vector<Patch> patches;  ///< lengths in lattice units; origins relative to the lower corner of the node's cell
    std::vector<LeftDisc> left;  ///< discs that cover the triangles of the node that are in no patch
    uint64_t trianglesLeft = 0;
    double error = 0;  ///< bound of the distance between the triangles and all that, both ways, lattice units
};

/// Maps of a node's patches.
struct NodeMaps {
    uint32_t texels = 1;  ///< along an edge of a cell: 1 (none), 2, 4 or 8; 0: as many as the source's textures hold,
    uint32_t most = 8;    ///< but no more than that
    double sourceTexel = 0;  ///< side of those of the source, lattice units; 0: it has none
    bool hasNormals = false, hasMaterials = false;
    bool hasLight = false;  ///< also without maps of anything else
    /// Of texels beside steps of that length, lattice units; 0: there are no maps.
    double side(double step) const {
        if (texels > 0) return texels == 1 ? 0 : step / texels;
        return sourceTexel > 0 ? std::max(sourceTexel, step / most) : 0;
    }
};

struct NodeSettings {
    double step = 1;          ///< of the level's grid, lattice units
    double coneDegrees = 50;  ///< half the cone of a patch's normals
    /// Samples aimed at for each of its triangles, of a leaf: its grid may be up to four times as fine as the level's,
    /// and a little coarser. 0: of an inner node, whose discs are united in cells of a quarter of a step.
    double samplesATriangle = 0;
    bool isAsked = false;               ///< somebody did: as many as that, within a tenth if steps can do it
    PlaceLooks looks;                   ///< of materials; empty: vertices say all
    bool hasFineNormals = false;        ///< some of it is a mirror
    const LevelLooks* below = nullptr;  ///< looks of triangles that are simplified ...
    double belowStep = 1;               ///< ... in cells of this edge, lattice units
    NodeMaps maps;
    std::function<bool()> isStopped;  ///< what is there then is of no use
};
NodePatches patchesOfNode(const Soup& own, const AroundNode& around, const glm::dvec3& corner,
                          const NodeSettings& settings, Executor& executor);

}  // namespace stipple::lod
