// What travels between the steps of a build of points. Everything hangs on the lattice: a point's place in the octree,
// the cells that records stand for, the windows of estimates. So neither the number of threads nor the memory nor the
// order of the input can show in the file.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lod/build/build.h"
#include "lod/build/morton.h"
#include "lod/hierarchy.h"

namespace stipple::lod {

/// Of the whole cloud: world = origin + unit * (x, y, z), below 2^rootLog2. Errors are coded against `errors`.
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
Frame makeFrame(const glm::dvec3& origin, double unit, uint32_t largest, uint32_t leafRecords);

/// Points on the lattice. Arrays are parallel; `normal` and `radius` may be empty until they are estimated.
struct Points {
    std::vector<uint32_t> x, y, z;
    std::vector<uint32_t> colour;  ///< r g b 8 | flags 8
    std::vector<uint32_t> normal;  ///< octahedral; meaning given by the flags
    std::vector<float> radius;     ///< lattice units; 0: to be estimated
    std::vector<std::vector<uint8_t>> attributes;
    size_t size() const { return x.size(); }
    glm::dvec3 at(size_t i) const { return {x[i], y[i], z[i]}; }
};

/// In Morton order; points with one key in the order of all they hold, so that any order of the input gives the same.
struct SortedPoints {
    Points points;
    std::vector<uint64_t> key;
};

}  // namespace stipple::lod
