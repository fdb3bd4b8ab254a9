// Which of many places lie in a box.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lod/builder/points/lattice_box.h"

namespace stipple::lod {

/// Coordinates of 32 bits.
struct NarrowPlaces {
    const uint32_t *x, *y, *z;
};
/// Box of them, both ends inside; on no axis lo > hi.
struct NarrowBox {
    std::array<uint32_t, 3> lo, hi;
};
inline constexpr size_t kMostInside = 256;
/// Writes the numbers of those places of [begin, end) that are inside the box; returns how many. end - begin is at most
/// kMostInside, and `inside` has room for all of them.
size_t findInside(const NarrowPlaces& places, size_t begin, size_t end, const NarrowBox& box, uint32_t* inside);

/// Calls f(i) for those of any [begin, end), in order; for none where lo > hi on an axis.
template <typename F>
void forInside(const NarrowPlaces& places, size_t begin, size_t end, const LatticeBox& box, const F& f) {
    NarrowBox narrow{};
    for (size_t a = 0; a < 3; ++a) {
        if (box.lo[a] > box.hi[a] || box.hi[a] < 0 || box.lo[a] > int64_t{UINT32_MAX}) return;
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
