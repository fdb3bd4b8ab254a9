// Points of a scan as they travel: from the input to the subtrees near which they lie, and from the patches of a node
// to the level above.
#pragma once

#include "lod/builder/octree/bytes.h"
#include "lod/builder/octree/frame.h"
#include "lod/builder/points/points.h"
#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// On its way to a subtree; words as `Points` has them.
struct ScanPoint {
    uint32_t x = 0, y = 0, z = 0, colour = 0, normal = 0;
};

/// The key of the cell of a place (lattice units); what lies beside the root's cell belongs to its last ones.
Key keyOfPlace(const Frame& frame, const glm::dvec3& p);

/// Appends point `i` with its colour and, where `from` has normals, its normal.
void append(PointBlock& to, const PointBlock& from, size_t i);
/// Lattice units. Without normals where one of them lacks its own.
PointBlock blockOf(const std::vector<ScanPoint>& points);
void putBlock(const PointBlock& block, ByteWriter& to);
/// Appends; false if the bytes are not what putBlock wrote.
bool getBlock(ByteReader& from, PointBlock& to);

/// Of each cubic cell of that edge the point that is nearest to the mean of those in it; in the order of the cells.
PointBlock thinned(const PointBlock& block, double edge);

}  // namespace stipple::lod
