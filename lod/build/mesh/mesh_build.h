// One build of a mesh store: from triangles to a verified file.
#pragma once

#include <string>

#include "lod/build/build.h"
#include "lod/mesh.h"
#include "lod/store.h"

namespace stipple::lod {

struct MeshBuildSettings {
    uint32_t groupClusters = 8;
    StoreDescription description;        ///< what the input says; bounds and counts are filled in
    std::vector<TextureImage> textures;  ///< that the description's materials name
};

/// Writes `output` (whole or not at all). Degenerate, duplicate and not finite triangles are dropped and counted. The
/// same input gives the same bytes for any number of threads.
Result<BuildReport> buildMeshStore(TriangleMesh mesh, const std::string& output, const MeshBuildSettings& settings,
                                   Executor& executor, Progress& progress);

}  // namespace stipple::lod
