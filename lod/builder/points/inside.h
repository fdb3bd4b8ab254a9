// Which of many places lie in a box.
#pragma once

#include <algorithm>
#include <array>

#include "lod/builder/points/lattice_box.h"

namespace stipple::lod {

/// Coordinates of 32 bits.
struct NarrowPlaces {
    const uint32_t *x, *y, *z;
};
/// Box of them, both ends inside.
struct NarrowBox {
    std::array<uint32_t, 3> lo, hi;
};
/// Writes the numbers of those places of [begin, end), at most kMostInside, that are inside the box; returns how many.
inline constexpr size_t kMostInside = 256;
size_t findInside(const NarrowPlaces& places, size_t begin, size_t end, const NarrowBox& box, uint32_t* inside);

/// Calls f(i) for those, in order.
template <typename F>
void forInside(const NarrowPlaces& places, size_t begin, size_t end, const LatticeBox& box, const F& f) {
    NarrowBox narrow{};
    for (size_t a = 0; a < 3; ++a) {
        if (box.hi[a] < 0 || box.lo[a] > int64_t{UINT32_MAX}) return;
        narrow.lo[a] = static_cast<uint32_t>(std::max<int64_t>(box.lo[a], 0));
        narrow.hi[a] = static_cast<uint32_t>(std::min(box.hi[a], int64_t{UINT32_MAX}));
    }
    std::array<uint32_t, kMostInside> inside;
    for (; begin < end; begin += kMostInside) {
        const size_t found = findInside(places, begin, std::min(begin + kMostInside, end), narrow, inside.data());
        for (size_t k = 0; k < found; ++k) f(inside[k]);
    }
}

}  // namespace stipple::lod
