// One build of a strand store: from polylines to a verified file.
#pragma once

#include <string>

#include "lod/builder/build.h"
#include "lod/primitives/strand_source.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct StrandBuildSettings {
    BuildLimits limits;
    uint32_t leafSegments = 2048;  ///< cells with more are divided, as far as their segments are short enough
    StoreDescription description;  ///< what the input says; bounds and counts are filled in
};

/// Writes `output` (whole or not at all). What `source` gives is clean (see cleanSource). The same strands give the
/// same bytes for any memory and number of threads. What does not fit in memory lies on disk, and an interrupted build
/// of the same source goes on where it was.
Result<BuildReport> buildStrandStore(const StrandSource& source, const std::string& output,
                                     const StrandBuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
