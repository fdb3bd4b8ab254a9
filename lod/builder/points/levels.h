// Coarser records from finer ones, with errors that bound the leaves below (ALGORITHMS 2.2 is the source: the slab of a
// record's leaves travels upwards with it).
//
// An inner node of level L has one record per occupied cell of level L + 6. It stands for the records of its children
// in that cell: centre, normal and colour are the means over the leaves, its radius reaches round all their discs. Of
// the leaves below a record is known, in lattice units:
//   above, below   how far they reach over and under the plane of its disc
//   inner          how far they reach from its centre in every direction of that plane, at least
//   core, hole     no place of its disc within `core` of the centre is farther than `hole` from where one of them is
// The slab of a coarser disc follows from those of the finer ones, tilted by the angle between both planes; so does
// `inner`, over 16 directions (between two of them it may be less by 2 % of the radius). The error is
//   sqrt(max(above, below)^2 + max(0, radius - inner)^2)
// (sequential point trees, Dachsbacher et al. 2003), at least the diameter where the colours below differ by more than
// kColourSpread, and never less than that of a record below. `inner` sees no holes: so it is raised until no place of
// the disc is farther than that from a leaf of the node (covered.h). Both ways, then, it bounds the distance between
// what is drawn and the leaves.
#pragma once

#include "lod/builder/octree/assemble.h"
#include "lod/builder/points/points.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

/// A record on its way up.
struct AggregateRecord {
    Key key = 0;                                 ///< of the first point below
    uint32_t first = 0;                          ///< of the points below, where those are at hand
    uint32_t count = 0;                          ///< points below
    glm::dvec3 mean{0};                          ///< of them, lattice units
    glm::vec3 meanNormal{0};                     ///< at most of length 1
    glm::vec3 meanColour{0};                     ///< linear
    std::array<uint8_t, 3> least{}, greatest{};  ///< of their colours
    uint8_t flags = 0, code = 0;
    uint8_t parentCode = static_cast<uint8_t>(ErrorScale::kNoParent);
    glm::dvec3 place{0};  ///< of the disc as it is written
    glm::vec3 normal{0};  ///< the same
    float radius = 0, above = 0, below = 0;
    float inner = 0;  ///< of a single leaf its own radius
    float core = 0, hole = 0;
    shared::PointRecord packed{};
};
/// What a coarse record says of an attribute: a mean, or a stored value and how many points below have it.
struct AggregateValue {
    double mean = 0;
    uint64_t stored = 0;
    uint64_t votes = 0;
};

/// Points [first, first + count) of many.
struct LeafPoints {
    const Points& points;
    std::span<const Key> key;  ///< of its own points alone
    size_t first;
    size_t count() const { return key.size(); }
};

/// A node whose records are known and whose chunk is not yet written, as its order needs the parent's codes.
struct PendingNode {
    Node node;
    Key key = 0;                           ///< of its cell: Morton code of `keyLevels` levels
    std::vector<AggregateRecord> records;  ///< of an inner node
    std::vector<AggregateValue> values;    ///< records x attributes
    // Of a leaf: its points, which lie among those of its subtree, and are its own once it leaves that.
    const SortedPoints* among = nullptr;
    size_t firstPoint = 0;
    SortedPoints own;
    std::vector<uint8_t> leafParentCode;
    LeafPoints leaf() const {
        const SortedPoints& of = among != nullptr ? *among : own;
        return {of.points, std::span(of.key).subspan(firstPoint, leafParentCode.size()), firstPoint};
    }
};

/// Points [first, first + normal.size()) with their normals decoded (zero: none), to measure against.
struct Leaves {
    const Points& points;
    std::span<const Key> key;  ///< of all points
    size_t first = 0;
    std::vector<glm::vec3> normal;
    bool hasNormals;  ///< any of them
    const glm::vec3& normalOf(size_t point) const { return normal[point - first]; }
};

/// Makes the parent of `children` (in octant order), encodes them into `batch` and empties them. `leaves`: see
/// makeSubtree.
PendingNode makeParent(const Frame& frame, std::span<PendingNode> children, NodeBatch& batch, const Leaves* leaves);
/// The root has no parent, and an overview before its records (overview.h).
void finishRoot(const Frame& frame, PendingNode& root, NodeBatch& batch);
/// The whole subtree over the points [begin, end), which lie in one cell of `level`. Errors inside it are measured
/// against the points themselves and not against what travels upwards, which is 25 % looser. Rounds radii to what the
/// leaves' records hold.
PendingNode makeSubtree(const Frame& frame, SortedPoints& from, size_t begin, size_t end, uint32_t level,
                        NodeBatch& batch);

}  // namespace stipple::lod
