// One build of a store of elevation patches from points: from scans to a verified file.
#pragma once

#include <string>
#include <vector>

#include "lod/builder/build.h"

namespace stipple::lod {

struct ScanBuildSettings {
    BuildSettings points;          ///< how the input is read; its limits are those of the build
    double coneDegrees = 50;       ///< half the cone of a patch's normals
    uint64_t samples = 0;          ///< of the finest level, about; 0: as many as there are points
    uint32_t leafPoints = 16'384;  ///< that a leaf has at most, where there are as many samples as points
};

/// Writes `output` (whole or not at all). Points that no patch stands for stay points beside the patches, with a disc
/// about each; at one place one is kept. The same points give the same bytes in any order, for any memory and number of
/// threads. What does not fit in memory lies on disk, and an interrupted build of the same source goes on where it was.
/// Error: points some of which lie so far out that 32 bits do not hold all places.
Result<BuildReport> buildScanStore(const std::vector<std::string>& inputs, const std::string& output,
                                   const ScanBuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
