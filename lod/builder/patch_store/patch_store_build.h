// One build of a store of elevation patches: from triangles to a verified file.
#pragma once

#include <string>

#include "lod/builder/build.h"
#include "lod/primitives/mesh_source.h"
#include "lod/primitives/place_look.h"
#include "lod/store/store.h"

namespace stipple::lod {

struct PatchBuildSettings {
    BuildLimits limits;
    double readerShare = 0;           ///< of the memory that was asked for, which is no part of `limits`: the source's
    double coneDegrees = 50;          ///< half the cone of a patch's normals
    uint64_t samples = 0;             ///< of the finest level, about; 0: as many as there are vertices
    uint32_t leafTriangles = 32'768;  ///< that a leaf has at most, where there are as many samples as vertices
    /// Of materials, numbers in description.pointMaterials; empty: vertices say all. `looksIdentity`: another number
    /// for other looks.
    PlaceLooks looks;
    uint64_t looksIdentity = 0;
    MapSettings maps;              ///< of what they say
    StoreDescription description;  ///< what the input says; bounds and counts are filled in
};

/// Writes `output` (whole or not at all). Degenerate, duplicate and not finite triangles are dropped and counted;
/// triangles that no patch stands for become discs beside the patches. The same triangles give the same bytes in any
/// order, for any memory and number of threads. What does not fit in memory lies on disk, and an interrupted build of
/// the same source goes on where it was. Error: a mesh some of whose places lie far out of all others.
Result<BuildReport> buildPatchStore(const MeshSource& source, const std::string& output,
                                    const PatchBuildSettings& settings, Executor& executor, Progress& progress);

}  // namespace stipple::lod
