// One cell of a build of patches: an octree of its triangles, patches of every node from the leaves up, and what goes
// up from the last one.
#pragma once

#include "lod/builder/octree/assemble.h"
#include "lod/builder/octree/reduction.h"
#include "lod/builder/patch_store/node_patches.h"

namespace stipple::lod {

/// How far around a cell triangles are needed, in parts of its edge.
constexpr double kPatchMargin = kPatchAround / kPatchCells;

struct PatchCellSettings {
    uint32_t leafTriangles = 32'768;
    double coneDegrees = 50;
    double samplesATriangle = 0.5;  ///< of the leaves
};

/// What a product's table holds.
struct PatchTable {
    struct Points {            ///< of a node: what no patch stands for
        uint32_t node = 0;     ///< into the batch
        uint32_t isAlone = 0;  ///< the node has no patches
        uint32_t records = 0, bytes = 0;
        uint64_t offset = 0, hash = 0;
    };
    NodeBatch batch;                                  ///< parents' codes are not known
    std::vector<Points> points;                       ///< ascending
    uint64_t triangles = 0, duplicate = 0, left = 0;  ///< of the leaves
    uint64_t samples = 0, discs = 0;                  ///< of the leaves: of patches, and instead of triangles
    double residual = 0;                              ///< of the leaves, lattice units
    Steps lo{0}, hi{0};                               ///< of vertices, where there are triangles
    void put(ByteWriter& to) const;
    bool get(ByteReader& from);
};

/// `input`: soups of what lies in the cell and around it; `subtrees`: of all of the build.
Result<CellProduct> buildPatchCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame,
                                   const std::vector<Subtree>& subtrees, const PatchCellSettings& settings,
                                   Executor& executor);

}  // namespace stipple::lod
