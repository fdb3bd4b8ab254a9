// All checks of a glTF file, in the order in which one makes the next safe.
#pragma once

#include "engine/scene/gltf/accessors.h"

namespace stipple::scene::gltf {

/// What is wrong with a file whose container could be read; empty: nothing. `buffers` is loaded on the way.
Result<Problems> checkAll(const Container& container, Buffers& buffers);

/// checkAll as one error: the first problem, and how many more there are. A required extension that is not understood
/// is refused by name. With `repair`, harmless ones are no error but the result.
Result<std::vector<std::string>> requireGood(const Container& container, Buffers& buffers, bool repair);

}  // namespace stipple::scene::gltf
