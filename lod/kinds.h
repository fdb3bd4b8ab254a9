// What kinds of primitives there are: one record each of all that stores, cuts and checks have to know of a kind.
// Everything else asks this table. (Progressive stores hold points in another order.)
#pragma once

#include <limits>
#include <span>
#include <string>

#include "lod/cut.h"
#include "lod/store.h"

namespace stipple::lod {

enum class Kind : uint8_t { points, curves, triangles };
inline constexpr size_t kKinds = 3;

struct CutFrame;
struct ActiveMembers;

/// What a cut of one instance costs.
struct CutCost {
    uint64_t records = 0;  ///< and triangles
    bool isWhole = true;   ///< all its chunks can be drawn
};
/// Which chunks a cost counts with: all of the store, or those that can be drawn.
enum class Counted : uint8_t { all, drawable };

struct KindTraits {
    const char* name;
    uint32_t recordBytes;  ///< of a decoded record
    /// Bytes of a decoded chunk of a node.
    uint64_t (*decodedBytes)(const Hierarchy& h, uint32_t node);
    /// The chunks of nodes that must be there before this node's is of use.
    std::span<const uint32_t> (*dependsOn)(const Hierarchy& h, uint32_t node);
    Result<Chunk> (*decode)(const Hierarchy& h, uint32_t node, const uint8_t* bytes, size_t count,
                            const std::string& where, bool wantLowBits);
    /// Is a node's chunk what the node table says of it? Empty, or what is wrong.
    std::string (*check)(const Hierarchy& h, uint32_t node, const Chunk& chunk);
    /// Are the errors of a node's records (`discs`: of so many of them) no larger than stated? How many were measured.
    Result<uint64_t> (*measure)(const Store& store, uint32_t node, const Chunk& chunk, uint64_t discs);
    /// Those of its records that nothing finer replaces.
    uint64_t (*leafRecords)(const Hierarchy& h, uint32_t node);
    /// What the cut of an instance has at tau = 2^(step/32) px; stops counting above `most`. Changes nothing.
    /// `members`: of instance groups, those that are drawn themselves; may be null.
    CutCost (*cutCost)(const CutFrame& frame, uint32_t instance, int step, uint64_t most, Counted counted,
                       ActiveMembers* members);
    /// Appends it to the cut.
    void (*cutEmit)(const CutFrame& frame, uint32_t instance, int step, ActiveMembers& members, Cut& cut);
};

inline Kind kindOf(const Hierarchy& h) {
    return h.isStrands ? Kind::curves : h.isMesh() ? Kind::triangles : Kind::points;
}
const KindTraits& traitsOf(Kind kind);
inline const KindTraits& traitsOf(const Hierarchy& h) { return traitsOf(kindOf(h)); }

/// Bytes of a decoded chunk: of a node, or of a texture's tile.
uint64_t decodedBytes(const Hierarchy& h, uint32_t chunk);

}  // namespace stipple::lod
