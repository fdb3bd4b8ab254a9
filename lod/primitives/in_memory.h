// Points that the program made itself, as a source like any file.
#pragma once

#include "lod/primitives/primitives.h"

namespace stipple::lod {

/// `info`: path, format and what the points mean; numbers and flags are taken from `points`.
PointSource pointsInMemory(SourceInfo info, PointBlock points);

}  // namespace stipple::lod
