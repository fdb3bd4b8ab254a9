// Where the curves of a build come from.
#pragma once

#include <functional>

#include "engine/base/result.h"
#include "lod/primitives/curves.h"

namespace stipple::lod {

/// Curves that are read block by block, as often as it takes: they need not fit in memory.
struct CurveSource {
    /// Blocks hold whole curves; what a block's `dropped`, `mended` and `notes` say is of that block.
    using Take = std::function<Result<void>(const CurveSet& block)>;

    uint64_t vertices = 0;               ///< about
    bool isPlant = true;                 ///< wind bends it; not so neurons, streamlines, hair
    std::function<uint64_t()> identity;  ///< another number: the source has changed
    /// Gives every curve once, always the same, and at least one block.
    std::function<Result<void>(const Take& take)> read;
};

/// Of curves in memory.
CurveSource sourceOf(CurveSet curves);
/// The same curves as cleanCurves would leave them.
CurveSource cleanSource(const CurveSource& raw, double defaultRadius);
/// Everything in one.
Result<CurveSet> collect(const CurveSource& source);

}  // namespace stipple::lod
