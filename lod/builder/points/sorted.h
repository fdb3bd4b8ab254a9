// A bucket in memory, in an order that does not depend on how its points came.
#pragma once

#include "lod/builder/points/bucket.h"

namespace stipple::lod {

/// More points than that at one lattice place tell nothing, and no leaf could hold them.
constexpr size_t kMostAtOnePlace = kSubtreePoints;

struct SortResult {
    SortedPoints sorted;
    uint64_t tooMany = 0;  ///< left out: beyond kMostAtOnePlace at one place
    uint64_t merged = 0;   ///< left out: at the place of another
};
/// `mergeDuplicates`: of points at one place only the first of the order stays. A bucket of more than `most` points
/// (all in one cell of the deepest level) is taken piece by piece.
Result<SortResult> sortBucket(const Frame& frame, const RecordLayout& layout, Spill& bucket, bool mergeDuplicates,
                              uint64_t most);

/// Places of points that others may look at.
struct Places {
    std::vector<Key> key;
    std::vector<uint32_t> x, y, z;
    std::vector<uint64_t> high;  ///< see Place
};
/// Thinned like the buckets that they come from.
Places sortGhosts(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                  bool mergeDuplicates);

}  // namespace stipple::lod
