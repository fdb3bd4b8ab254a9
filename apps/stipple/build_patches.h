// `stipple build --patches`: stores of elevation patches.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "apps/stipple/common.h"
#include "lod/primitives/mesh.h"
#include "lod/store/description.h"

namespace stipple::app {

/// Colours of vertices times those of their materials.
void bakeMaterials(const scene::Scene& scene, lod::TriangleMesh& mesh);

/// Places of all points of what can be opened as a scan.
Result<std::vector<glm::dvec3>> readPlaces(const std::string& input, const scene::ReadSettings& reading);
/// Has the input triangles? (It may be no file: a folder or an octree of scans.)
bool hasTriangles(const std::string& input);

/// All triangles of a file that has some or of a scene. Error: there are none.
Result<lod::TriangleMesh> readTriangles(const std::string& input, const scene::ReadSettings& reading);

/// For --json; null where there are none.
nlohmann::json patchCountsJson(const lod::PatchCounts& of);

/// Adds --patches and what belongs to it.
void addPatchBuildOptions(CLI::App& app, PatchBuildOptions& o);

/// Of meshes: PLY files that all have faces, or one scene; of scans: whatever else is read as points.
Result<lod::BuildReport> buildPatches(const std::vector<std::string>& inputs, const std::string& output,
                                      const BuildOptions& build, Executor& executor, Progress& progress);

}  // namespace stipple::app
