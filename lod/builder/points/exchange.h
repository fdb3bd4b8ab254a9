// Buckets that the ranks of a build have built, on their way to the first rank: in a folder that all of them see.
#pragma once

#include "lod/builder/points/bucket.h"
#include "lod/builder/points/ranges.h"
#include "lod/builder/points/upper.h"

namespace stipple::lod {

/// What one bucket gives, until it is its turn to be written.
struct BuiltBucket {
    std::vector<BuiltSubtree> subtrees;
    ValueRanges ranges;
    uint64_t merged = 0, tooMany = 0;
    std::map<std::string, double> seconds;  ///< of the thread
};

/// Is it there, and whole?
bool isBuilt(const std::string& folder, size_t bucket);
Result<void> saveBuilt(const std::string& folder, size_t bucket, const BuiltBucket& built);
Result<BuiltBucket> loadBuilt(const std::string& folder, size_t bucket, const ValueRanges& empty);

}  // namespace stipple::lod
