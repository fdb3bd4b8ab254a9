// All checks of a glTF file, in the order in which one makes the next safe.
#pragma once

#include "engine/scene/gltf/accessors.h"

namespace stipple::scene::gltf {

/// What is wrong with a file whose container could be read; empty: nothing. On the way `buffers` is loaded, and what is
/// compressed with Draco unpacked.
Result<Problems> checkAll(Container& container, Buffers& buffers);

/// checkAll as one error: the first problem, and how many more there are. What cannot be drawn is refused; with
/// `isStrict`, whatever the specification forbids. Otherwise those faults are mended or passed over, and are the
/// result.
Result<std::vector<std::string>> requireGood(Container& container, Buffers& buffers, bool isStrict);

}  // namespace stipple::scene::gltf
