// The overview of a store (Hierarchy::overviewOf) against its leaves: is each of them within the errors that its levels
// state? (Of the other way, discs against leaves, errors.h tells.)
#pragma once

#include "lod/verify/discs.h"

namespace stipple::lod {

class OverviewLevels {
  public:
    /// None where the store has no overview, or where its chunk cannot be read: who reads that says so.
    explicit OverviewLevels(const Store& store);

    /// Middles and rims of about `most` records of a leaf: every level has a disc within its error of each. An error if
    /// one has not; else how many records were measured.
    Result<uint64_t> measure(uint32_t leaf, const Chunk& chunk, uint64_t most) const;

  private:
    const Store& store_;
    std::vector<std::vector<Disc>> levels_;
};

}  // namespace stipple::lod
