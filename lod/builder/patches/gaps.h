// Triangles that close what is open between patches (Ochotta & Hiller 2006, 3.3).
#pragma once

#include "lod/builder/patches/patch_build.h"

namespace stipple::lod {

/// Adds `set.gaps`, counts them in `set.triangles`, and what stays open in `set.openEdges`.
void fillGaps(PatchSet& set);

std::array<glm::dvec3, 3> placesOf(const PatchSet& set, const std::array<PatchCorner, 3>& gap);

}  // namespace stipple::lod
