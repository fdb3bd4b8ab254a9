// Where the strands of a build come from.
#pragma once

#include <functional>

#include "engine/base/result.h"
#include "lod/primitives/strands.h"

namespace stipple::lod {

/// Strands that are read block by block, as often as it takes: they need not fit in memory.
struct StrandSource {
    /// Blocks hold whole strands; what a block's `dropped`, `mended` and `notes` say is of that block.
    using Take = std::function<Result<void>(const StrandSet& block)>;

    uint64_t vertices = 0;               ///< about
    bool isPlant = true;                 ///< wind bends it; not so neurons, streamlines, hair
    std::function<uint64_t()> identity;  ///< another number: the source has changed
    /// Gives every strand once, always the same, and at least one block.
    std::function<Result<void>(const Take& take)> read;
};

/// Of strands in memory.
StrandSource sourceOf(StrandSet strands);
/// The same strands as cleanStrands would leave them.
StrandSource cleanSource(const StrandSource& raw, double defaultRadius);
/// Everything in one.
Result<StrandSet> collect(const StrandSource& source);

}  // namespace stipple::lod
