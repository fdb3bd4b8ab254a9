// The value at a rank among few, fast.
#pragma once

#include <cstddef>
#include <cstdint>

namespace stipple::lod {

/// Values come in vectors (of kLanes, engine/base/lanes.h); those behind the last are this.
inline constexpr int32_t kNothing = INT32_MAX;

/// The value at `rank` (0: the least) of `count` > `rank` non-negative floats, given as their bits: those have the same
/// order. `values` has room for whole vectors. `guess`: about the result, if known; 0: it is not.
float smallestAtRank(const int32_t* values, size_t count, size_t rank, float guess);

/// Squared distances of n points from one, as bits of floats, in whole vectors.
void squaredDistances(const float* x, const float* y, const float* z, size_t n, const float (&from)[3], int32_t* out);

}  // namespace stipple::lod
