// PLY files with faces: triangles, unless only their points are wanted.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/open/open_scene.h"
#include "lod/builder/mesh/mesh_build.h"

namespace stipple::scene {

/// What some inputs hold, as files.
struct PlyMeshes {
    std::vector<std::string> files;  ///< with faces, of which not only the vertices are wanted
    size_t others = 0;               ///< files without
    std::vector<std::string> notes;  ///< on what was named twice
    /// Are they built as triangles?
    bool areAll() const { return !files.empty() && others == 0; }
    /// What is lost where they are built as points, beside files that have nothing else; empty: nothing.
    std::string note() const;
};
/// What --surfels is told where there are no meshes.
tl::unexpected<Error> nothingToSample(const std::string& input);
/// What --material is told where there are no points.
tl::unexpected<Error> noPointsToLight(const std::string& input);
Result<PlyMeshes> findPlyMeshes(const std::vector<std::string>& inputs, const OpenSettings& build);

/// The triangles of all `files` in one store. `settings`: without limits and source.
Result<lod::BuildReport> buildPlyMeshes(const std::vector<std::string>& files, const std::string& output,
                                        const OpenSettings& build, lod::MeshBuildSettings settings, Executor& executor,
                                        Progress& progress);

}  // namespace stipple::scene
