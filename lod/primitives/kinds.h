// What kinds of primitives there are: one record each of all that stores, cuts and checks have to know of a kind.
// Everything else asks this table. (Stochastic stores hold points in another order.)
#pragma once

#include <limits>
#include <span>
#include <string>

#include "lod/cut/cut.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct CutFrame;
struct ActiveMembers;

/// What a cut of one instance costs.
struct CutCost {
    uint64_t records = 0;  ///< and triangles
    bool isWhole = true;   ///< all its chunks can be drawn
};
/// Which chunks a cost counts with: all of the store, or those that can be drawn.
enum class Counted : uint8_t { all, drawable };

/// What a view asks of a payload of an octree's node: records are drawn whose parents' errors are larger than
/// `parentCode` and whose own are not larger than `code`, or that stand in the octants of `octantMask`, whose children
/// are not there.
struct Asked {
    uint32_t code = 0, parentCode = 0, octantMask = 0;
    int32_t epsilon = 0;       ///< allowed error of the node, see cut_view.h
    uint32_t largestCode = 0;  ///< the largest code that may be allowed
};

struct KindTraits {
    const char* name;      ///< in files: at most 23 letters, and never another meaning
    const char* records;   ///< what its records are called
    uint32_t recordBytes;  ///< of a decoded record
    uint32_t cellBits;     ///< steps of a node's cell of an octree: 2^cellBits; 0: its places are not of the cell
    /// Bytes of a decoded chunk.
    uint64_t (*decodedBytes)(const Hierarchy& h, uint32_t chunk);
    /// Is a payload of an octree possible, beside what all have in common? Nothing was read but the tables.
    bool (*isPossible)(const Hierarchy& h, uint32_t chunk);
    /// Is a chunk, as it is drawn (readDrawnChunk), what the tables say of it? Empty, or what is wrong.
    std::string (*check)(const Hierarchy& h, uint32_t index, const Chunk& chunk);
    /// Are the errors of a chunk's records (`discs`: of so many of them) no larger than stated? How many were measured.
    /// Of stores that have no other kind; of a chunk as it is drawn.
    Result<uint64_t> (*measure)(const Store& store, uint32_t index, const Chunk& chunk, uint64_t discs);
    /// Those of its records that nothing finer replaces.
    uint64_t (*leafRecords)(const Hierarchy& h, uint32_t chunk);
    /// Records (triangles) that a cut has of a payload of an octree. Changes nothing.
    uint64_t (*cutCost)(const Hierarchy& h, uint32_t chunk, const Asked& asked);
    /// Appends them to the cut.
    void (*cutEmit)(const CutFrame& frame, uint32_t instance, uint32_t chunk, const Asked& asked, Cut& cut);
};

#define STIPPLE_KIND(name) extern const KindTraits name##Kind;
#include "lod/primitives/kinds.inl"
#undef STIPPLE_KIND

const KindTraits& traitsOf(Kind kind);
inline Kind kindOf(const Hierarchy& h, uint32_t chunk) { return h.payload(chunk).kind; }

/// How the nodes of a store hang together: an octree, an octree of stochastic points, a graph of groups.
struct ShapeTraits {
    const char* name;
    /// The nodes that must be there before this one is of use.
    std::span<const uint32_t> (*dependsOn)(const Hierarchy& h, uint32_t node);
    /// What the cut of an instance has at tau = 2^(step/32) px; stops counting above `most`. Changes nothing.
    /// `members`: of instance groups, those that are drawn themselves; may be null.
    CutCost (*cutCost)(const CutFrame& frame, uint32_t instance, int step, uint64_t most, Counted counted,
                       ActiveMembers* members);
    /// Appends it to the cut.
    void (*cutEmit)(const CutFrame& frame, uint32_t instance, int step, ActiveMembers& members, Cut& cut);
};
const ShapeTraits& shapeOf(const Hierarchy& h);

/// Calls use(chunk) for all that must be there before a chunk is of use: the payloads of the nodes above.
template <typename Use>
void forEachRequired(const Hierarchy& h, uint32_t chunk, const Use& use) {
    if (h.isTile(chunk)) return;
    for (const uint32_t node : shapeOf(h).dependsOn(h, h.nodeOf(chunk))) h.forEachPayload(node, use);
}
/// Of a root, which is never given up.
inline bool isOfRoot(const Hierarchy& h, uint32_t chunk) {
    return !h.isTile(chunk) && shapeOf(h).dependsOn(h, h.nodeOf(chunk)).empty();
}

/// Bytes of a decoded chunk.
uint64_t decodedBytes(const Hierarchy& h, uint32_t chunk);

}  // namespace stipple::lod
