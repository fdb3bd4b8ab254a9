// Missing radii and normals, from windows of the lattice.
#pragma once

#include "engine/base/executor.h"
#include "lod/builder/points/sorted.h"

namespace stipple::lod {

struct EstimateSettings {
    bool radii = true, normals = true;
    bool isFine = false;  ///< a point's own twelve nearest instead of one plane for each cell
    bool limitStrays = true;
};

/// The points of the counted cells [firstCell, firstCell + cells), all of `own`. `ghosts`: points of other buckets near
/// by, at least all that those cells see (see Distributor). Rounds normals to what records hold. Threads of `executor`
/// that have nothing else to do take cells.
void estimate(const Frame& frame, const CellTree& tree, uint32_t firstCell, uint32_t cells,
              const EstimateSettings& settings, const Places& ghosts, Executor& executor, SortedPoints& own);

}  // namespace stipple::lod
