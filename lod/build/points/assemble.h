// The node table of a store from the nodes that were written.
#pragma once

#include "lod/build/points/levels.h"

namespace stipple::lod {

/// `batches` hold every node of one octree once; their chunk offsets are those in the file.
Hierarchy assemble(const Frame& frame, const std::vector<NodeBatch>& batches);

}  // namespace stipple::lod
