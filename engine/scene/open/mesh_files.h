// Files of triangles (PLY with faces, and what else the table of formats has), unless only points are wanted of them.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/open/open_scene.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/import/formats.h"

namespace stipple::scene {

/// What some inputs hold, as files.
struct MeshFiles {
    std::vector<std::string> files;  ///< with triangles, of which not only points are wanted
    size_t others = 0;               ///< files without
    std::vector<std::string> notes;  ///< on what was named twice
    /// Are they built as triangles?
    bool areAll() const { return !files.empty() && others == 0; }
    /// What is lost where they are built as points, beside files that have nothing else; empty: nothing.
    std::string note() const;
};
/// Of the memory for a build, what a reader of triangles holds.
constexpr double kReaderShare = 0.25;
/// What --surfels is told where there are no meshes.
tl::unexpected<Error> nothingToSample(const std::string& input);
/// What --material is told where there are no points.
tl::unexpected<Error> noPointsToLight(const std::string& input);
Result<MeshFiles> findMeshFiles(const std::vector<std::string>& inputs, const OpenSettings& build);

/// The triangles of all `files` in one store. `settings`: without limits and source.
Result<lod::BuildReport> buildMeshFiles(const std::vector<std::string>& files, const std::string& output,
                                        const OpenSettings& build, lod::MeshBuildSettings settings, Executor& executor,
                                        Progress& progress);

/// The same of what is open; `held`: what it holds of the memory asked for.
Result<lod::BuildReport> buildOpened(const lod::OpenedMesh& mesh, uint64_t held, const std::string& output,
                                     const OpenSettings& build, lod::MeshBuildSettings settings, Executor& executor,
                                     Progress& progress);

/// The triangles of several files as one, with what there is to say of each.
Result<lod::OpenedMesh> openMeshes(const std::vector<std::string>& files, const lod::FormatOptions& more);

}  // namespace stipple::scene
