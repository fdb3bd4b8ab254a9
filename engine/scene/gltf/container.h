// A glTF 2.0 file taken apart: its JSON text and, for .glb, its binary chunk. Nothing is understood here.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/base/byte_source.h"
#include "engine/base/result.h"
#include "engine/scene/scene_bytes.h"

namespace stipple::scene::gltf {

struct Container {  // NOLINT(bugprone-exception-escape): moving JSON checks its own invariants
    nlohmann::json json;
    std::vector<uint8_t> binary;  ///< chunk 1 of a .glb
    bool isBinary = false, hasBinaryChunk = false;
    std::string path, folder;
    Resolve resolve;  ///< what it names; empty: files in `folder`
    uint64_t fileBytes = 0;
    std::vector<std::string> oddities;  ///< not as the format has it, and passed over
};

/// Of a .glb: both chunks, or the JSON alone, which a few reads of any file give.
enum class Want { all, json };
/// `.gltf` or `.glb`, told by content. Errors name the offset. What would take more than `memoryBytes` is refused.
Result<Container> readContainer(const ByteSource& file, uint64_t memoryBytes = uint64_t{2} << 30,
                                Want want = Want::all);
Result<Container> readContainer(const std::string& path, uint64_t memoryBytes = uint64_t{2} << 30,
                                Want want = Want::all);
/// What it says of itself, whatever it holds.
inline Result<Container> readContainerJson(const std::string& path) {
    return readContainer(path, uint64_t{2} << 30, Want::json);
}

}  // namespace stipple::scene::gltf
