// What a glTF file must satisfy beyond its structure: the node graph, mesh primitives, materials, animations, skins,
// extents of buffer views and accessors. The structure must have been checked before.
#pragma once

#include "engine/scene/gltf/schema.h"

namespace stipple::scene::gltf {

void checkGraph(const nlohmann::json& root, Problems& problems);
void checkMeshes(const nlohmann::json& root, Problems& problems);
void checkExtents(const nlohmann::json& root, bool isBinary, bool hasBinaryChunk, uint64_t binaryBytes,
                  Problems& problems);
void checkAnimationsAndSkins(const nlohmann::json& root, Problems& problems);
void checkMaterialsAndExtensions(const nlohmann::json& root, Problems& problems);

/// Bytes of one component, components of one element, columns of a matrix type (1 otherwise).
size_t componentBytes(int componentType);
size_t componentsOf(const std::string& type);
/// Bytes from one element to the next if the buffer view has no stride; matrix columns begin at multiples of four.
size_t elementBytes(const std::string& type, int componentType);
/// The same without what pads the last column.
size_t lastElementBytes(const std::string& type, int componentType);

}  // namespace stipple::scene::gltf
