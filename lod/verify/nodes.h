// A chunk against what the tables say of it: all that the cut relies on.
#pragma once

#include <string>

#include "lod/store/chunk.h"
#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// Of points and curves, as they are drawn: codes, counts, order, sphere and cone, and that levels of an overview give
/// way to each other. Empty, or what is wrong.
std::string checkNode(const Hierarchy& h, uint32_t index, const Chunk& chunk);
/// Of a group of triangles: places, runs, and that it lies inside its parents.
std::string checkGroup(const Hierarchy& h, uint32_t index, const Chunk& chunk);

}  // namespace stipple::lod
