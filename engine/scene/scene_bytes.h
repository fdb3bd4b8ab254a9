// Scenes whose bytes, and those of what they name, come from anywhere.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/scene/scene.h"
#include "lod/store/file_kind.h"

namespace stipple::scene {

/// The bytes of what a scene names: buffers, pictures, libraries of materials. `name`: as nameOfUri gives it, or a URL.
/// Null: there is nothing of that name.
using Resolve = std::function<Result<std::shared_ptr<const ByteSource>>(const std::string& name)>;

/// readGltf, readObj and readScene of any bytes; their path says the format where they do not. Without `resolve` what
/// they name are files in the folder of that path; with it no file is read, and stores that nodes place are left out,
/// with a note.
Result<Scene> readGltf(const ByteSource& file, const ReadSettings& settings, const Resolve& resolve = {});
Result<Scene> readObj(const ByteSource& file, const ReadSettings& settings, const Resolve& resolve = {});
Result<Scene> readScene(const ByteSource& file, const ReadSettings& settings, const Resolve& resolve = {});

/// .gltf, .glb or .obj, unless the bytes are of another kind; what begins as a .glb whatever its name.
bool isScene(const std::string& path, lod::FileKind kind);

/// What a scene in `folder` calls `name`, if it is no more than the memory allowed.
Result<std::vector<uint8_t>> readNamed(const Resolve& resolve, const std::string& folder, const std::string& name,
                                       const ReadSettings& settings);

}  // namespace stipple::scene
