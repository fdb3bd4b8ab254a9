// Whether circles cover a disc, seen along rays from its centre: between two of them the disc is held as far out as one
// circle after the other holds both rays. That errs towards what is not covered only. Lengths are lattice units.
#pragma once

#include <array>
#include <cstddef>

#include "engine/base/lanes.h"

namespace stipple::lod {

/// Circles in a disc's plane, around its centre.
struct Circles {
    static constexpr size_t kMost = 1024;
    using Column = std::array<float, kMost + kLanes>;  ///< whole vectors may be read
    alignas(64) Column u, v, radius;
    size_t count = 0;
    /// Not if there is no room left, nor if the radius is not above 0 (or is not a number): fewer circles cover less.
    void add(float atU, float atV, float r) {
        if (!(r > 0) || count == kMost) return;
        u[count] = atU;
        v[count] = atV;
        radius[count++] = r;
    }
    struct Range {
        size_t first = 0, last = 0;
    };
};

/// Rays from the disc's centre, and how far out circles hold it between each two.
class Fan {
  public:
    static constexpr size_t kRays = 32;
    explicit Fan(float radius) : radius_(radius), rim_(radius / kNarrowest) {}

    /// One circle after the other, until the disc is held. True: it is; the others are not looked at then, so
    /// only a new fan knows how far out all of them hold.
    bool add(const Circles& circles);
    /// The same with all of them. Gives the radius of a disc that is held.
    float addAll(const Circles& circles);
    /// Of what is still open between two rays, all that a single one of those circles holds. `circlesAt(u, v)`: which
    /// of `circles` to try for that place, just inside the rim between both rays. All places are asked for before any
    /// circle is tried: it may append to these `circles`. True: the disc is held.
    template <typename CirclesAt>
    bool close(const Circles& circles, const CirclesAt& circlesAt) {
        std::array<Circles::Range, kRays> tried;
        const Middles& middles = middlesOfRays();
        for (size_t k = 0; k < kRays; ++k)
            if (held_[k] < rim_) tried[k] = circlesAt(middles.x[k] * radius_, middles.y[k] * radius_);
        return closeBy(circles, tried);
    }
    /// By how much circles would have to be wider for a single one to hold what is open between each two rays, at most.
    float missing(const Circles& circles) const;

  private:
    static constexpr float kNarrowest = 0.99518f;  ///< cosine of half the angle between two rays
    /// Between the ends of each ray, at length 1, and the next one's.
    struct Middles {
        std::array<float, kRays> x, y;
    };
    static const Middles& middlesOfRays();
    bool closeBy(const Circles& circles, const std::array<Circles::Range, kRays>& tried);

    float radius_, rim_;
    alignas(64) std::array<float, kRays> held_{};
};

}  // namespace stipple::lod
