// One build of a curve store: from polylines to a verified file.
#pragma once

#include <string>

#include "lod/builder/build.h"
#include "lod/primitives/curve_source.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct CurveBuildSettings {
    BuildLimits limits;
    uint32_t leafSegments = 2048;  ///< cells with more are divided, as far as their segments are short enough
    StoreDescription description;  ///< what the input says; bounds and counts are filled in
};

/// Writes `output` (whole or not at all). What `source` gives is clean (see cleanSource). The same curves give the
/// same bytes for any memory and number of threads. What does not fit in memory lies on disk, and an interrupted build
/// of the same source goes on where it was.
Result<BuildReport> buildCurveStore(const CurveSource& source, const std::string& output,
                                    const CurveBuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
