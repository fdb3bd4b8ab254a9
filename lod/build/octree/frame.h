// The lattice and the octree over it that a build hangs everything on.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "lod/build/morton.h"
#include "lod/hierarchy.h"

namespace stipple::lod {

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
    uint64_t keyOf(uint32_t x, uint32_t y, uint32_t z) const {
        const uint32_t drop = rootLog2 - keyLevels;
        return mortonCode(x >> drop, y >> drop, z >> drop);
    }
};
inline ErrorScale errorsOf(uint32_t rootLog2) {
    return {std::exp2(static_cast<double>(rootLog2) + 2) / std::exp2(ErrorScale::kLargest / 8.0)};
}
/// `largest`: coordinate of what is to lie in it.
inline Frame makeFrame(const glm::dvec3& origin, double unit, uint32_t largest, uint32_t leafRecords) {
    Frame f;
    f.origin = origin;
    f.unit = unit;
    f.rootLog2 = static_cast<uint32_t>(std::bit_width(std::max(largest, 1u)));
    f.keyLevels = std::min(f.rootLog2, kMortonBits);
    f.leafRecords = leafRecords;
    f.errors = errorsOf(f.rootLog2);
    return f;
}

}  // namespace stipple::lod
