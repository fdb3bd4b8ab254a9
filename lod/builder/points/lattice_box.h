// Boxes of the lattice, and places in them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "lod/builder/octree/frame.h"

namespace stipple::lod {

/// Lattice box, both ends inside.
struct LatticeBox {
    std::array<int64_t, 3> lo{}, hi{};
    bool holds(int64_t x, int64_t y, int64_t z) const {
        return x >= lo[0] && x <= hi[0] && y >= lo[1] && y <= hi[1] && z >= lo[2] && z <= hi[2];
    }
    LatticeBox grown(int64_t by) const {
        LatticeBox b = *this;
        for (size_t a = 0; a < 3; ++a) {
            b.lo[a] -= by;
            b.hi[a] += by;
        }
        return b;
    }
};

/// Passes on each place once; copies lie side by side.
template <typename F>
struct OncePerPlace {
    F f;
    mutable std::array<int64_t, 3> last{-1, -1, -1};
    void operator()(int64_t x, int64_t y, int64_t z) const {
        if (isSame(last, {x, y, z})) return;
        last = {x, y, z};
        f(x, y, z);
    }
};
template <typename F>
OncePerPlace(F) -> OncePerPlace<F>;
}  // namespace stipple::lod
