// How the surfaces of a glTF file look, and what light there is. Whatever is missing or broken is left out with a note.
#pragma once

#include "engine/scene/gltf/accessors.h"
#include "engine/scene/scene.h"

namespace stipple::scene::gltf {

/// Materials, images, textures, lights and cameras of a checked file. Errors are those of the budget.
Result<void> readLooks(const Container& container, Buffers& buffers, Scene& scene);

}  // namespace stipple::scene::gltf
