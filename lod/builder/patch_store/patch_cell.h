// One cell of a build of patches: an octree of its triangles, patches of every node from the leaves up, and what goes
// up from the last one.
#pragma once

#include "lod/builder/octree/reduction.h"
#include "lod/builder/patch_store/patch_nodes.h"

namespace stipple::lod {

/// How far around a cell triangles are needed, in parts of its edge.
constexpr double kPatchMargin = kPatchAround / kPatchCells;

struct PatchCellSettings {
    uint32_t leafTriangles = 32'768;
    double coneDegrees = 50;
    double samplesATriangle = 0.5;    ///< of the leaves
    bool isAsked = false;             ///< somebody asked for that many
    PlaceLooks looks;                 ///< of materials; empty: vertices say all
    MapSettings maps;                 ///< of what looks say
    bool hasFineNormals = false;      ///< some of it is a mirror
    double rounding = 0;              ///< most that a place is moved to lie on the lattice, lattice units
    std::function<bool()> isStopped;  ///< what is there then is of no use
};

/// `input`: soups of what lies in the cell and around it; `subtrees`: of all of the build.
Result<CellProduct> buildPatchCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame,
                                   const std::vector<Subtree>& subtrees, const PatchCellSettings& settings,
                                   Executor& executor);

}  // namespace stipple::lod
