// What the ranks of a build on several machines hand to each other, through a folder that all of them see.
#pragma once

#include "engine/base/ranks.h"
#include "lod/build/points/bucket.h"
#include "lod/build/points/ranges.h"
#include "lod/build/points/upper.h"

namespace stipple::lod {

/// What one bucket gives, until it is its turn to be written.
struct BuiltBucket {
    std::vector<BuiltAtom> atoms;
    ValueRanges ranges;
    uint64_t merged = 0, tooMany = 0;
    std::map<std::string, double> seconds;  ///< of the thread
};

/// Bucket b is built by rank b modulo their number.
inline bool isOwn(const Ranks* ranks, size_t bucket) {
    return ranks == nullptr || bucket % static_cast<size_t>(ranks->count()) == static_cast<size_t>(ranks->rank());
}

/// A folder for this rank's share of the buckets, empty; the first rank makes the whole one.
Result<void> makeSharedFolder(Ranks& ranks, const std::string& folder);
std::string ownFolder(const Ranks& ranks, const std::string& folder);
/// After all ranks have distributed their points: each appends to its own buckets what the others have for them.
Result<void> collectBuckets(Ranks& ranks, const std::string& folder, Buckets& buckets);

Result<void> saveBuilt(const std::string& folder, size_t bucket, const BuiltBucket& built);
Result<BuiltBucket> loadBuilt(const std::string& folder, size_t bucket, const ValueRanges& empty);

}  // namespace stipple::lod
