// A store of patches against what it was built from.
#pragma once

#include <vector>

#include "engine/base/executor.h"
#include "lod/primitives/mesh.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// Distances in units of the file.
struct AgainstSource {
    double stated = 0;                    ///< largest bound that the store says of a leaf
    double toSource = 0, fromSource = 0;  ///< largest of places of the leaves' patches, and of the source
    uint64_t placesOfStore = 0, placesOfSource = 0;
    double most = 0;   ///< of both, what was measured in parts of what that leaf states, at most
    uint64_t far = 0;  ///< of both: farther than stated of their leaf
};

/// Measures about `places` places each way, evenly spread over triangles and cells, against all of the other surface.
/// `source` has to be in the store's coordinates, and fits in memory. Error: a chunk cannot be read, or the store holds
/// no patches.
Result<AgainstSource> measureAgainst(const Store& store, TriangleMesh source, uint64_t places, Executor& executor);

/// Likewise of a scan, whose points need no order: each of them lies within what is stated of a leaf. Back, a place is
/// told as far only where the nearest point is farther than that and six spacings of its own: a scan says no more.
Result<AgainstSource> measureAgainst(const Store& store, std::vector<glm::dvec3> points, uint64_t places,
                                     Executor& executor);

}  // namespace stipple::lod
