// Meshes that are compressed with Draco (KHR_draco_mesh_compression), through libdraco.
#pragma once

#include "engine/scene/gltf/accessors.h"

namespace stipple::scene::gltf {

/// Whatever only the compressed form has becomes plain accessors of a buffer of its own, so that nobody else knows of
/// Draco; where plain accessors are there already, those stay. The structure must have been checked, and the buffers
/// loaded.
Result<void> unpackDraco(Container& container, Buffers& buffers, Problems& problems);

}  // namespace stipple::scene::gltf
