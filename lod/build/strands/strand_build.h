// One build of a strand store: from polylines to a verified file.
#pragma once

#include <string>

#include "lod/build/build.h"
#include "lod/store.h"
#include "lod/strands.h"

namespace stipple::lod {

struct StrandBuildSettings {
    uint32_t leafSegments = 2048;  ///< cells with more are divided, as far as their segments are short enough
    StoreDescription description;  ///< what the input says; bounds and counts are filled in
};

/// Writes `output` (whole or not at all). `strands` are clean. The same input gives the same bytes for any number of
/// threads.
Result<BuildReport> buildStrandStore(const StrandSet& strands, const std::string& output,
                                     const StrandBuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
