// What travels between the steps of a build of points. Everything hangs on the lattice: a point's place in the octree,
// the cells that records stand for, the windows of estimates. So neither the number of threads nor the memory nor the
// order of the input can show in the file.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lod/builder/octree/cells.h"

namespace stipple::lod {

/// Points on the lattice. Arrays are parallel; `normal` and `radius` may be empty until they are estimated.
struct Points {
    std::vector<uint32_t> x, y, z;
    std::vector<uint64_t> high;    ///< see Place; empty where 32 bits hold all coordinates
    std::vector<uint32_t> colour;  ///< r g b 8 | flags 8
    std::vector<uint32_t> normal;  ///< octahedral; meaning given by the flags
    std::vector<float> radius;     ///< lattice units; 0: to be estimated
    std::vector<std::vector<uint8_t>> attributes;
    size_t size() const { return x.size(); }
    Place place(size_t i) const { return placeOf(x[i], y[i], z[i], high.empty() ? 0 : high[i]); }
    glm::dvec3 at(size_t i) const {
        if (high.empty()) return {x[i], y[i], z[i]};
        const Place p = place(i);
        return {p[0], p[1], p[2]};
    }
    Coordinates coordinates() const { return {x, y, z, high}; }
};

/// In Morton order; points with one key in the order of all they hold, so that any order of the input gives the same.
struct SortedPoints {
    Points points;
    std::vector<Key> key;
};

}  // namespace stipple::lod
