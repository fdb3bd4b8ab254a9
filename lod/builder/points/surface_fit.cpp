#include "lod/builder/points/surface_fit.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/base/lanes.h"
#include "engine/base/wide.h"
#include "lod/builder/points/select.h"

namespace stipple::lod {
namespace {

constexpr size_t kHalf = kDirections / 2;
static_assert(kHalf == kLanes);

constexpr double kThin = 0.02;    ///< second variance over the first: a line, whatever the third
constexpr double kRound = 12.0;   ///< second variance over the third, of a line with noise at most
constexpr double kRoundings = 4;  ///< second variance over that of rounding

constexpr size_t kNearest = 3;  ///< vectors of a neighbourhood, after which hardly anything comes nearer
constexpr float kSteep = 0.5f;  ///< squared cosine of a neighbour's angle to the plane, at least
constexpr float kSteepest = 1.5867f;

struct Sums {
    float n;
    std::array<float, 3> mean;
    std::array<float, 6> products;  ///< xx xy xz yy yz zz
};

}  // namespace

STIPPLE_WIDE static void addUp(const Neighbours& all, const float (&from)[3], const int32_t* squared, int32_t limit,
                               Sums& sums) {
    const auto* const distance = reinterpret_cast<const Anywhere<Lanes>*>(squared);
    const auto* const x = reinterpret_cast<const Anywhere<Floats>*>(all.x);
    const auto* const y = reinterpret_cast<const Anywhere<Floats>*>(all.y);
    const auto* const z = reinterpret_cast<const Anywhere<Floats>*>(all.z);
    const size_t vectors = (all.count + kLanes - 1) / kLanes;
    const auto total = [](const Floats& v) {
        float sum = 0;
        for (size_t k = 0; k < kLanes; ++k) sum += v[k];
        return sum;
    };
    Lanes count{};
    Floats mx{}, my{}, mz{};
    for (size_t i = 0; i < vectors; ++i) {
        const Lanes within = distance[i].v <= limit;
        count -= within;
        Floats dx = x[i].v - from[0], dy = y[i].v - from[1], dz = z[i].v - from[2];
        for (Floats* d : {&dx, &dy, &dz}) keepOnly(*d, within);
        mx += dx;
        my += dy;
        mz += dz;
    }
    int32_t n = 0;
    for (size_t k = 0; k < kLanes; ++k) n += count[k];
    sums.n = static_cast<float>(n);
    const float scale = n > 0 ? 1.0f / sums.n : 0.0f;
    sums.mean = {from[0] + scale * total(mx), from[1] + scale * total(my), from[2] + scale * total(mz)};
    Floats xx{}, xy{}, xz{}, yy{}, yz{}, zz{};
    for (size_t i = 0; i < vectors; ++i) {
        const Lanes within = distance[i].v <= limit;
        Floats dx = x[i].v - sums.mean[0], dy = y[i].v - sums.mean[1], dz = z[i].v - sums.mean[2];
        for (Floats* d : {&dx, &dy, &dz}) keepOnly(*d, within);
        xx += dx * dx;
        xy += dx * dy;
        xz += dx * dz;
        yy += dy * dy;
        yz += dy * dz;
        zz += dz * dz;
    }
    sums.products = {total(xx), total(xy), total(xz), total(yy), total(yz), total(zz)};
}

namespace {

/// What neighbours say of the extents in half of the directions, and in those opposite. Lanes are directions.
struct Extents {
    Lanes there{}, opposite{};
    [[gnu::always_inline]] float least() const {
        const Lanes lesser = there < opposite ? there : opposite;
        return std::bit_cast<float>(leastOf(lesser));
    }
};

/// Neighbours after inversion in the unit sphere, in the plane's axes; of those that do not count 0, which says
/// nothing.
struct Inverted {
    alignas(64) std::array<float, kNearest * kLanes> u, v;
};

/// A place on a surface, and the axes of the plane there.
struct PlaneAt {
    const float (&from)[3], (&axis)[3], (&across)[3];  // NOLINT: as they come

    /// Squared distances of vector `i` of the neighbours.
    [[gnu::always_inline]] void measure(const Neighbours& all, size_t i, Floats& dx, Floats& dy, Floats& dz,
                                        Floats& squared) const {
        dx = floatsAt(all.x, kLanes * i).v - from[0];
        dy = floatsAt(all.y, kLanes * i).v - from[1];
        dz = floatsAt(all.z, kLanes * i).v - from[2];
        squared = dx * dx + dy * dy + dz * dz;
    }
    [[gnu::always_inline]] void invert(const Floats& dx, const Floats& dy, const Floats& dz, const Floats& squared,
                                       const Lanes& isMeant, Inverted& inverted, size_t to) const {
        const Floats u = dx * axis[0] + dy * axis[1] + dz * axis[2],
                     v = dx * across[0] + dy * across[1] + dz * across[2];
        const Floats flat = u * u + v * v;
        Floats root = flat * squared;
        takeRoots(root);
        const Lanes counts = isMeant & (flat > 0.0f) & (flat >= kSteep * squared);
        Floats inverse = 1.0f / root;
        keepOnly(inverse, counts);
        floatsAt(inverted.u.data(), kLanes * to).v = u * inverse;
        floatsAt(inverted.v.data(), kLanes * to).v = v * inverse;
    }
};

/// Of the first `vectors` of them.
[[gnu::always_inline]] inline void extend(const Inverted& inverted, size_t vectors, Extents& extents) {
    // The first half of the directions; the others are opposite.
    const Floats cosines{1, 0.92387953f, 0.70710678f, 0.38268343f, 0, -0.38268343f, -0.70710678f, -0.92387953f},
        sines{0, 0.38268343f, 0.70710678f, 0.92387953f, 1, 0.92387953f, 0.70710678f, 0.38268343f};
    constexpr auto kSign = static_cast<int32_t>(0x80000000u);
    Lanes there = extents.there, opposite = extents.opposite;
    for (size_t k = 0; k < vectors * kLanes; ++k) {
        // Non-negative floats have the order of their bits, negative ones are less than 0 as integers too.
        const Lanes along = reinterpret_cast<Lanes>(cosines * inverted.u[k] + sines * inverted.v[k]),
                    against = along ^ kSign;
        there = along > there ? along : there;
        opposite = against > opposite ? against : opposite;
    }
    extents.there = there;
    extents.opposite = opposite;
}

}  // namespace

/// First the vectors in the middle of the neighbourhood, where the nearest are. Neighbours that cannot raise the least
/// value above `floor` are left out, which most of the others cannot then.
STIPPLE_WIDE static void supports(const Neighbours& all, const float (&from)[3], const float (&axis)[3],
                                  const float (&across)[3], float floor, int32_t* out) {
    const PlaneAt plane{from, axis, across};
    const size_t vectors = (all.count + kLanes - 1) / kLanes;
    const size_t first = vectors > 1 ? vectors / 2 - 1 : 0, last = std::min(first + kNearest, vectors);
    float farthest = 1 / (floor * floor);  // squared distance of what can still count
    const auto keepThose = [&](size_t i, Lanes& isMeant) {
        isMeant &= kLaneNumbers < static_cast<int32_t>(all.count - kLanes * i);
    };
    Floats dx, dy, dz, squared;
    Inverted inverted;
    Extents extents;
    for (size_t i = first; i < last; ++i) {
        plane.measure(all, i, dx, dy, dz, squared);
        Lanes isMeant = (squared > 0.0f) & (squared < farthest);  // (not itself)
        keepThose(i, isMeant);
        plane.invert(dx, dy, dz, squared, isMeant, inverted, i - first);
    }
    extend(inverted, last - first, extents);
    const float bound = std::max(floor, extents.least() * 0.999f);
    farthest = 1 / (bound * bound);
    for (size_t i = 0; i < vectors; ++i) {
        if (i == first) i = last;
        if (i >= vectors) break;
        plane.measure(all, i, dx, dy, dz, squared);
        Lanes isMeant = (squared > 0.0f) & (squared < farthest);
        keepThose(i, isMeant);
        if (!isAny(isMeant)) continue;
        plane.invert(dx, dy, dz, squared, isMeant, inverted, 0);
        extend(inverted, 1, extents);
    }
    for (size_t k = 0; k < kHalf; ++k) {
        out[k] = extents.there[k];
        out[k + kHalf] = extents.opposite[k];
    }
}

bool Spread::isLine(double rounding, double slim) const {
    return points < 3 || !(middle > kRoundings * rounding) || !(middle > kThin * most) ||
           (middle < slim * most && middle < kRound * least);
}

Spread spreadOf(const Neighbours& all, const float (&from)[3], const int32_t* squared, float reach) {
    Sums sums{};
    addUp(all, from, squared, std::min(std::bit_cast<int32_t>(reach), kNothing - 1), sums);
    Spread spread;
    spread.points = static_cast<size_t>(sums.n);
    if (spread.points < 3) return spread;
    const double scale = 1.0 / static_cast<double>(sums.n);
    const auto product = [&](size_t k) { return static_cast<double>(sums.products.at(k)) * scale; };
    Eigen::Matrix3d c;
    c << product(0), product(1), product(2), product(1), product(3), product(4), product(2), product(4), product(5);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(c);
    const Eigen::Vector3d& v = solver.eigenvalues();
    spread.least = std::max(v[0], 0.0);
    spread.middle = std::max(v[1], 0.0);
    spread.most = std::max(v[2], 0.0);
    const auto vectorOf = [&](Eigen::Index k) {
        const Eigen::Vector3d e = solver.eigenvectors().col(k);
        const glm::vec3 out(e[0], e[1], e[2]);
        return std::isfinite(out.x + out.y + out.z) ? out : glm::vec3(0);
    };
    spread.normal = vectorOf(0);
    spread.along = vectorOf(2);
    return spread;
}

std::array<float, kDirections> inverseExtents(const Neighbours& all, const float (&from)[3], const glm::vec3& axis,
                                              const glm::vec3& across, float most) {
    std::array<int32_t, kDirections> bits{};
    supports(all, from, {axis.x, axis.y, axis.z}, {across.x, across.y, across.z}, 0.499f / most, bits.data());
    return std::bit_cast<std::array<float, kDirections>>(bits);
}

STIPPLE_WIDE static int32_t leastCorner(const int32_t* around, float floor, float steep) {
    const int32_t least = std::bit_cast<int32_t>(floor);
    Lanes found = Lanes{} + kNothing;
    for (size_t i = 0; i < kDirections; i += kLanes) {
        const Lanes left = reinterpret_cast<const Anywhere<Lanes>*>(around + i)->v,
                    h = reinterpret_cast<const Anywhere<Lanes>*>(around + i + 1)->v,
                    right = reinterpret_cast<const Anywhere<Lanes>*>(around + i + 2)->v;
        const Lanes nearer = left < right ? left : right;
        const Lanes steepest = reinterpret_cast<Lanes>(steep * reinterpret_cast<Floats>(h));
        const Lanes isCorner = (h >= least) & (h <= nearer) & (nearer <= steepest);
        const Lanes here = isCorner ? h : Lanes{} + kNothing;
        found = here < found ? here : found;
    }
    return leastOf(found);
}

float farthestCorner(const std::array<float, kDirections>& inverse, float most, bool isUneven) {
    // Non-negative floats as their bits, with those at both ends once more.
    std::array<int32_t, kDirections + 2> around{};
    std::memcpy(&around[1], inverse.data(), sizeof inverse);
    around[0] = around[kDirections];
    around[kDirections + 1] = around[1];
    // Twice the distance is 1 over the value: no distance over an infinite one, which hides no other.
    const int32_t found =
        leastCorner(around.data(), 0.5f / most, isUneven ? std::numeric_limits<float>::infinity() : kSteepest);
    return found < kNothing ? 0.5f / std::bit_cast<float>(found) : 0.0f;
}

}  // namespace stipple::lod
