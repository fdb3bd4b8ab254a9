// What a store of points says of its input.
#pragma once

#include "lod/builder/points/input.h"
#include "lod/store/description.h"

namespace stipple::lod {

/// Of a surveyed input. What the build makes of it (points, normals, rounding) is not filled in.
StoreDescription describeInput(const PointInput& input, const BuildSettings& settings);

}  // namespace stipple::lod
