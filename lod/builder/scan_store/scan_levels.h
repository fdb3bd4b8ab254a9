// Patches of a node against those of its children, both ways.
#pragma once

#include "lod/builder/scan_store/scan_patches.h"

namespace stipple::lod {

struct ChildPatches {
    const std::vector<Patch>* patches = nullptr;
    glm::dvec3 corner{0};  ///< of the child's cell: what their origins are relative to
    double edge = 0;       ///< of that
};

struct LevelSettings {
    glm::dvec3 corner{0};  ///< of the node's cell
    double edge = 0;       ///< of that
    double step = 1;       ///< how far from each other the two surfaces may be, below called a step
};

/// Takes away those cells of `made` in the node's cell that lie farther than a step from all of the children's patches,
/// and appends a disc for every triangle of those, in the child's cell, that then lies farther than that from `made`.
/// Returns the bound of the distance, either way, of all other places in these cells, lattice units; not less than a
/// tenth of a step.
double agreeWithChildren(const std::vector<ChildPatches>& children, const LevelSettings& settings, ScanPatches& made,
                         std::vector<LeftDisc>& uncovered);

}  // namespace stipple::lod
