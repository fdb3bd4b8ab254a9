// One cell of a build of patches from points: an octree of its points, patches of every node from the leaves up, and
// what goes up from the last one.
#pragma once

#include "lod/builder/octree/reduction.h"
#include "lod/builder/patch_store/patch_nodes.h"

namespace stipple::lod {

/// Cells of the grid along an edge of a node's cell.
constexpr uint32_t kScanCells = 80;
inline double scanStep(const Frame& frame, uint32_t level) { return frame.cellSize(level) / kScanCells; }
/// How far around a cell points are needed, in parts of its edge.
constexpr double kScanMargin = kPatchAround / kScanCells;

struct ScanCellSettings {
    uint32_t leafPoints = 16'384;
    double coneDegrees = 50;
    double samplesAPoint = 1;         ///< of the leaves
    bool isAsked = false;             ///< somebody asked for that many
    bool hasNormals = false;          ///< the source has, of all points
    double rounding = 0;              ///< most that a place is moved to lie on the lattice, lattice units
    std::function<bool()> isStopped;  ///< what is there then is of no use
};

/// `input`: ScanPoints of what lies in the cell and around it; `subtrees`: of all of the build.
Result<CellProduct> buildScanCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                  const std::vector<FromBelow>& below, const Frame& frame,
                                  const std::vector<Subtree>& subtrees, const ScanCellSettings& settings,
                                  Executor& executor);

}  // namespace stipple::lod
