// Stores of inputs that lie in memory, or whose bytes come from anywhere else.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/scene/open/open_scene.h"
#include "engine/scene/scene_bytes.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/primitives/curve_source.h"

namespace stipple::scene {

/// buildAny of bytes: points, triangles, curves or one scene, by what they begin with and how their paths end.
/// `resolve`: what the scene names. What an interrupted build left is not gone on with: it goes.
Result<lod::BuildReport> buildBytes(const std::vector<std::shared_ptr<const ByteSource>>& inputs,
                                    const Resolve& resolve, const std::string& output, const OpenSettings& build,
                                    Executor& executor, Progress& progress);

// What both have.
/// The triangles or the curves of a scene; `buildPoints`, where it has neither.
Result<lod::BuildReport> buildReadScene(Scene scene, const std::string& output, const OpenSettings& build,
                                        const std::function<Result<lod::BuildReport>()>& buildPoints,
                                        Executor& executor, Progress& progress);
/// Ribbons and tubes; `input` is their name.
Result<lod::BuildReport> buildCurves(const lod::CurveSource& raw, const std::string& input, const std::string& output,
                                     const OpenSettings& build, Executor& executor, Progress& progress);
/// Of files of triangles; their paths are made by whoever builds them.
Result<lod::MeshBuildSettings> meshFileSettings(const OpenSettings& build);

}  // namespace stipple::scene
