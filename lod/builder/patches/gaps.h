// Triangles that close what is open between patches (Ochotta & Hiller 2006, 3.3).
#pragma once

#include "lod/builder/patches/patch_build.h"

namespace stipple::lod {

/// Adds `set.gaps`, counts them in `set.triangles`, and what stays open in `set.openEdges`.
void fillGaps(PatchSet& set);

}  // namespace stipple::lod
