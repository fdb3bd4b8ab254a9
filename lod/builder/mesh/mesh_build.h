// One build of a mesh store: from triangles to a verified file.
#pragma once

#include <string>

#include "lod/builder/build.h"
#include "lod/primitives/mesh_source.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct MeshBuildSettings {
    BuildLimits limits;
    double readerShare = 0;  ///< of the memory that was asked for, which is no part of `limits`: what the source holds
    uint32_t groupClusters = 8;
    StoreDescription description;        ///< what the input says; bounds and counts are filled in
    std::vector<TextureImage> textures;  ///< that the description's materials name
};

/// Writes `output` (whole or not at all). Degenerate, duplicate and not finite triangles are dropped and counted. The
/// same triangles give the same bytes in any order, for any memory and number of threads. What does not fit in memory
/// lies on disk, and an interrupted build of the same source goes on where it was.
Result<BuildReport> buildMeshStore(const MeshSource& source, const std::string& output,
                                   const MeshBuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
