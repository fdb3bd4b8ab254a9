// What a camera must see of a store: points on its outside. A box is a poor measure of that: of a ball seen from the
// corner of its box, a third of the picture would stay empty.
#pragma once

#include <span>
#include <vector>

#include "lod/store/store.h"

namespace stipple::scene {

/// Of `points` those that reach farthest in any of 256 directions.
std::vector<glm::dvec3> outermost(std::span<const glm::dvec3> points);
/// Points on the outside of what is dense in a store, store units: of its coarsest chunks, read from the file, and none
/// beyond the box of focus. The corners of that box where chunks cannot be read.
std::vector<glm::dvec3> outlineOf(const lod::Store& store);

/// True of what is flat along z although another axis is said to be up: most likely a scan whose format does not say.
bool looksZUp(const lod::StoreDescription& description);

}  // namespace stipple::scene
