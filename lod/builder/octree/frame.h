// The lattice and the octree over it that a build hangs everything on.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "lod/builder/morton.h"
#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// Lattice coordinates, below 2^kPlaceBits: so many doubles hold. They are kept as 32 bits an axis, and where those are
/// too few as one more word with the `high` bits of all axes.
using Place = std::array<uint64_t, 3>;
/// (== of arrays is a call of memcmp.)
template <typename T>
bool isSame(const std::array<T, 3>& a, const std::array<T, 3>& b) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}
constexpr uint32_t kPlaceBits = 53;
inline Place placeOf(uint32_t x, uint32_t y, uint32_t z, uint64_t high) {
    constexpr uint32_t kBits = kPlaceBits - 32;
    constexpr uint64_t kMask = (uint64_t{1} << kBits) - 1;
    return {x | (high & kMask) << 32, y | (high >> kBits & kMask) << 32, z | (high >> (2 * kBits) & kMask) << 32};
}
inline uint64_t highOf(const Place& p) {
    constexpr uint32_t kBits = kPlaceBits - 32;
    return p[0] >> 32 | p[1] >> 32 << kBits | p[2] >> 32 << (2 * kBits);
}

/// Of a whole scene: world = origin + unit * (x, y, z), below 2^rootLog2. Errors are coded against `errors`.
struct Frame {
    glm::dvec3 origin{0};
    double unit = 1;
    uint32_t rootLog2 = 0, keyLevels = 0;
    uint32_t leafRecords = 8192;
    ErrorScale errors;
    std::vector<AttributeInfo> attributes;
    double cellSize(uint32_t level) const { return std::exp2(static_cast<double>(rootLog2) - level); }
    /// Key bits below a level.
    uint32_t shiftOf(uint32_t level) const { return 3 * (keyLevels - level); }
    Key keyOf(uint64_t x, uint64_t y, uint64_t z) const {
        const uint32_t drop = rootLog2 - keyLevels;
        return mortonCode(x >> drop, y >> drop, z >> drop);
    }
    Key keyOf(const Place& p) const { return keyOf(p[0], p[1], p[2]); }
};
/// Of a wide frame small errors are told apart and the largest are not: ErrorScale::kLargest is more than any.
inline ErrorScale errorsOf(uint32_t rootLog2) {
    constexpr uint32_t kWide = 34;
    return {std::exp2(std::min(rootLog2, kWide) + 2.0) / std::exp2(ErrorScale::kLargest / 8.0)};
}
/// `largest`: coordinate of what is to lie in it. `resolution`: how near to each other things may lie, lattice units;
/// 0: not known.
inline Frame makeFrame(const glm::dvec3& origin, double unit, uint64_t largest, uint32_t leafRecords,
                       double resolution = 0) {
    Frame f;
    f.origin = origin;
    f.unit = unit;
    f.rootLog2 = static_cast<uint32_t>(std::bit_width(std::max(largest, uint64_t{1})));
    // Short keys are sorted faster; they do, but where much lies within one of their cells.
    f.keyLevels = std::min(f.rootLog2, kShortBits);
    while (f.keyLevels < std::min(f.rootLog2, kMortonBits) && f.cellSize(f.keyLevels) > 0.0625 * resolution &&
           resolution > 0)
        ++f.keyLevels;
    f.leafRecords = leafRecords;
    f.errors = errorsOf(f.rootLog2);
    return f;
}

}  // namespace stipple::lod
