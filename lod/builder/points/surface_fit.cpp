#include "lod/builder/points/surface_fit.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/base/wide.h"
#include "lod/builder/points/select.h"

namespace stipple::lod {
namespace {

using Lanes = int32_t __attribute__((vector_size(4 * kSelectLanes), aligned(4), may_alias));
using Pairs = int64_t __attribute__((vector_size(4 * kSelectLanes), aligned(4), may_alias));
using Floats = float __attribute__((vector_size(4 * kSelectLanes), aligned(4), may_alias));
constexpr size_t kHalf = kDirections / 2;
static_assert(kHalf == kSelectLanes);

constexpr double kThin = 0.02;    ///< second variance over the first: a line, whatever the third
constexpr double kRound = 12.0;   ///< second variance over the third, of a line with noise at most
constexpr double kRoundings = 4;  ///< second variance over that of rounding

constexpr size_t kNearest = 3;  ///< vectors of a neighbourhood, after which hardly anything comes nearer
constexpr float kSteep = 0.5f;
constexpr float kSteepest = 1.5867f;

struct Sums {
    float n;
    std::array<float, 3> mean;
    std::array<float, 6> products;  ///< xx xy xz yy yz zz
};

}  // namespace

STIPPLE_WIDE static void addUp(const Neighbours& all, const float (&from)[3], const int32_t* squared, int32_t limit,
                               Sums& sums) {
    const auto* const distance = reinterpret_cast<const Lanes*>(squared);
    const auto* const x = reinterpret_cast<const Floats*>(all.x);
    const auto* const y = reinterpret_cast<const Floats*>(all.y);
    const auto* const z = reinterpret_cast<const Floats*>(all.z);
    const size_t vectors = (all.count + kSelectLanes - 1) / kSelectLanes;
    const auto keepOnly = [](Floats& v, const Lanes& mask) {
        v = reinterpret_cast<Floats>(reinterpret_cast<Lanes>(v) & mask);
    };
    const auto total = [](const Floats& v) {
        float sum = 0;
        for (size_t k = 0; k < kSelectLanes; ++k) sum += v[k];
        return sum;
    };
    Lanes count{};
    Floats mx{}, my{}, mz{};
    for (size_t i = 0; i < vectors; ++i) {
        const Lanes within = distance[i] <= limit;
        count -= within;
        Floats dx = x[i] - from[0], dy = y[i] - from[1], dz = z[i] - from[2];
        for (Floats* d : {&dx, &dy, &dz}) keepOnly(*d, within);
        mx += dx;
        my += dy;
        mz += dz;
    }
    int32_t n = 0;
    for (size_t k = 0; k < kSelectLanes; ++k) n += count[k];
    sums.n = static_cast<float>(n);
    const float scale = n > 0 ? 1.0f / sums.n : 0.0f;
    sums.mean = {from[0] + scale * total(mx), from[1] + scale * total(my), from[2] + scale * total(mz)};
    Floats xx{}, xy{}, xz{}, yy{}, yz{}, zz{};
    for (size_t i = 0; i < vectors; ++i) {
        const Lanes within = distance[i] <= limit;
        Floats dx = x[i] - sums.mean[0], dy = y[i] - sums.mean[1], dz = z[i] - sums.mean[2];
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

/// Neighbours that cannot raise the least value above `floor` are left out, which most cannot once the nearest ones
/// are in: those lie in the middle of a neighbourhood.
STIPPLE_WIDE static void supports(const Neighbours& all, const float (&from)[3], const float (&axis)[3],
                                  const float (&across)[3], float floor, int32_t* out) {
    // The first half of the directions; the others are opposite.
    const Floats cosines{1, 0.92387953f, 0.70710678f, 0.38268343f, 0, -0.38268343f, -0.70710678f, -0.92387953f},
        sines{0, 0.38268343f, 0.70710678f, 0.92387953f, 1, 0.92387953f, 0.70710678f, 0.38268343f};
    constexpr auto kSign = static_cast<int32_t>(0x80000000u);
    Lanes there{}, opposite{};
    float a[kSelectLanes], b[kSelectLanes];  // NOLINT: whole vectors
    const size_t vectors = (all.count + kSelectLanes - 1) / kSelectLanes;
    float farthest = 1 / (floor * floor);  // squared distance of what can still count
    for (size_t step = 0, at = vectors / 2; step < vectors; ++step) {
        // From the middle to both sides in turn.
        if (step > 0) at = at >= step && step % 2 == 1 ? at - step : at + step;
        const size_t i = kSelectLanes * at;
        const Floats dx = *reinterpret_cast<const Floats*>(all.x + i) - from[0],
                     dy = *reinterpret_cast<const Floats*>(all.y + i) - from[1],
                     dz = *reinterpret_cast<const Floats*>(all.z + i) - from[2];
        const Floats squared = dx * dx + dy * dy + dz * dz;
        Lanes counts = (squared > 0.0f) & (squared < farthest);  // (not itself)
        const size_t last = std::min(all.count - i, kSelectLanes);
        const auto& pairs = reinterpret_cast<const Pairs&>(counts);
        if ((pairs[0] | pairs[1] | pairs[2] | pairs[3]) == 0) continue;
        const Floats u = dx * axis[0] + dy * axis[1] + dz * axis[2],
                     v = dx * across[0] + dy * across[1] + dz * across[2];
        const Floats flat = u * u + v * v, product = flat * squared;
        counts &= (flat > 0.0f) & (flat >= kSteep * squared);
        for (size_t k = 0; k < kSelectLanes; ++k) a[k] = std::sqrt(product[k]);
        const Floats inverse =
            reinterpret_cast<Floats>(reinterpret_cast<Lanes>(1.0f / *reinterpret_cast<Floats*>(a)) & counts);
        *reinterpret_cast<Floats*>(a) = u * inverse;
        *reinterpret_cast<Floats*>(b) = v * inverse;
        for (size_t k = 0; k < last; ++k) {
            // Non-negative floats have the order of their bits, negative ones are less than 0 as integers too.
            const Lanes along = reinterpret_cast<Lanes>(cosines * a[k] + sines * b[k]), against = along ^ kSign;
            there = along > there ? along : there;
            opposite = against > opposite ? against : opposite;
        }
        if (step >= kNearest) continue;
        const Lanes lesser = there < opposite ? there : opposite;
        int32_t least = lesser[0];
        for (size_t k = 1; k < kSelectLanes; ++k) least = std::min(least, lesser[k]);
        const float bound = std::max(floor, std::bit_cast<float>(least) * 0.999f);
        farthest = 1 / (bound * bound);
    }
    for (size_t k = 0; k < kHalf; ++k) {
        out[k] = there[k];
        out[k + kHalf] = opposite[k];
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
    for (size_t i = 0; i < kDirections; i += kSelectLanes) {
        const Lanes left = *reinterpret_cast<const Lanes*>(around + i),
                    h = *reinterpret_cast<const Lanes*>(around + i + 1),
                    right = *reinterpret_cast<const Lanes*>(around + i + 2);
        const Lanes nearer = left < right ? left : right;
        const Lanes steepest = reinterpret_cast<Lanes>(steep * reinterpret_cast<const Floats&>(h));
        const Lanes isCorner = (h >= least) & (h <= nearer) & (nearer <= steepest);
        const Lanes here = isCorner ? h : Lanes{} + kNothing;
        found = here < found ? here : found;
    }
    int32_t result = kNothing;
    for (size_t k = 0; k < kSelectLanes; ++k) result = std::min(result, found[k]);
    return result;
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
