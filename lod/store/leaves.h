// The full detail of a store as a source of points or triangles: what other formats are written from.
#pragma once

#include <memory>

#include "lod/primitives/mesh_source.h"
#include "lod/primitives/primitives.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// The points of the leaves, one leaf a part, with all attributes in fp64 (what has no data stays what it was).
/// Positions are those of the lattice, exact where the store's are. Error: the store holds something else.
Result<PointSource> leafPoints(std::shared_ptr<const Store> store);

/// The triangles of the finest clusters, each cluster with vertices of its own; of positions alone. Error: the store
/// holds something else.
Result<MeshSource> leafTriangles(std::shared_ptr<const Store> store);

}  // namespace stipple::lod
