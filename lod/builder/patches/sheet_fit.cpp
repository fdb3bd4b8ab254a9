#include "lod/builder/patches/sheet_fit.h"

#include <algorithm>
#include <cmath>

#include "engine/base/wide.h"

namespace stipple::lod {
namespace {

constexpr int kMostMoves = 10;
constexpr double kAtRest = 1e-4;  ///< h
constexpr double kFlat = 1e-8;    ///< least pivot over the largest
constexpr size_t kTerms = 6, kLinear = 3;

using Four = double __attribute__((vector_size(32), may_alias));
using FourBits = int64_t __attribute__((vector_size(32)));

[[gnu::always_inline]] inline const Four& four(const double* p) { return *reinterpret_cast<const Four*>(p); }
[[gnu::always_inline]] inline double sumOf(const Four& v) { return (v[0] + v[1]) + (v[2] + v[3]); }

/// exp(v) of v in [-700, 0], to 1e-11 of it: 2^k times a polynomial of what is left.
[[gnu::always_inline]] inline void exponential(const Four& v, Four& out) {
    constexpr double kWhole = 6755399441055744.0;  // 1.5 * 2^52: the last bits of a sum with it are a whole number
    const Four shifted = v * 1.4426950408889634 + kWhole;
    const Four k = shifted - kWhole;
    const Four r = (v - k * 0.693147180369123816490) - k * 1.90821492927058770002e-10;
    Four p = r * (1.0 / 3628800) + 1.0 / 362880;
    for (const double next : {1.0 / 40320, 1.0 / 5040, 1.0 / 720, 1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1.0, 1.0})
        p = p * r + next;
    const FourBits scaled = __builtin_bit_cast(FourBits, p) + (__builtin_bit_cast(FourBits, shifted) << 52);
    out = __builtin_bit_cast(Four, scaled);
}

/// The lower half of the normal equations.
struct Equations {
    std::array<FitTerms, kTerms> m{};
    FitTerms right{};
};

[[gnu::always_inline]] inline void weigh(double height, double least, FitPoints& f) {
    for (size_t k = 0; k < f.n; k += 4) {
        const Four d = four(f.z + k) - height;
        exponential(least - four(f.squared + k) - d * d, reinterpret_cast<Four&>(f.weight[k]));
    }
    for (size_t k = f.n; k % 4 != 0; ++k) f.weight[k] = 0;
}

[[gnu::always_inline]] inline void accumulate(const FitPoints& f, bool isQuadratic, Equations& e) {
    Four s[15] = {}, right[kTerms] = {};  // NOLINT
    for (size_t k = 0; k < f.n; k += 4) {
        const Four x = four(f.x + k), y = four(f.y + k), z = four(f.z + k), w = four(f.weight + k);
        const Four wx = w * x, wy = w * y, xx = wx * x, xy = wx * y, yy = wy * y;
        s[0] += w;
        s[1] += wx;
        s[2] += wy;
        s[3] += xx;
        s[4] += xy;
        s[5] += yy;
        right[0] += w * z;
        right[1] += wx * z;
        right[2] += wy * z;
        if (!isQuadratic) continue;
        right[3] += xx * z;
        right[4] += xy * z;
        right[5] += yy * z;
        const Four xxx = xx * x, xxy = xx * y, xyy = xy * y, yyy = yy * y;
        s[6] += xxx;
        s[7] += xxy;
        s[8] += xyy;
        s[9] += yyy;
        s[10] += xxx * x;
        s[11] += xxx * y;
        s[12] += xxy * y;
        s[13] += xyy * y;
        s[14] += yyy * y;
    }
    const auto at = [&](size_t k) { return sumOf(s[k]); };
    e.m[0] = {at(0)};
    e.m[1] = {at(1), at(3)};
    e.m[2] = {at(2), at(4), at(5)};
    for (size_t k = 0; k < (isQuadratic ? kTerms : kLinear); ++k) e.right.at(k) = sumOf(right[k]);
    if (!isQuadratic) return;
    e.m[3] = {at(3), at(6), at(7), at(10)};
    e.m[4] = {at(4), at(7), at(8), at(11), at(12)};
    e.m[5] = {at(5), at(8), at(9), at(12), at(13), at(14)};
}

/// By L D L^T; false where the points say too little. (Coordinates are of the order of 1, so that pivots tell.)
template <size_t kCount>
[[gnu::always_inline]] inline bool solve(Equations& e, FitTerms& c) {
    auto& m = e.m;
    const double largest = m[0][0];
    FitTerms inverse{};
    for (size_t i = 0; i < kCount; ++i) {
        FitTerms scaled{};  // of row i, times the pivots
        for (size_t j = 0; j < i; ++j) {
            double v = m[i][j];
            for (size_t k = 0; k < j; ++k) v -= scaled[k] * m[j][k];
            scaled[j] = v;
            m[i][j] = v * inverse[j];
        }
        double pivot = m[i][i], right = e.right[i];
        for (size_t k = 0; k < i; ++k) {
            pivot -= scaled[k] * m[i][k];
            right -= m[i][k] * e.right[k];
        }
        if (!(pivot > kFlat * largest)) return false;
        inverse[i] = 1 / pivot;
        e.right[i] = right;
    }
    c = {};
    for (size_t i = kCount; i-- > 0;) {
        c[i] = e.right[i] * inverse[i];
        for (size_t k = i + 1; k < kCount; ++k) c[i] -= m[k][i] * c[k];
    }
    return true;
}

[[gnu::always_inline]] inline double looseness(const FitPoints& f, const FitTerms& c) {
    Four sum{}, weights{};
    for (size_t k = 0; k < f.n; k += 4) {
        const Four x = four(f.x + k), y = four(f.y + k), w = four(f.weight + k);
        const Four r = four(f.z + k) - (c[0] + x * (c[1] + c[3] * x + c[4] * y) + y * (c[2] + c[5] * y));
        sum += w * r * r;
        weights += w;
    }
    return std::sqrt(sumOf(sum) / sumOf(weights));
}

}  // namespace

STIPPLE_WIDE bool fitSheet(FitPoints& f, bool isQuadratic, SheetFit& fit) {
    if (f.n == 0) return false;
    for (size_t k = f.n; k % 4 != 0; ++k) f.x[k] = f.y[k] = f.z[k] = f.squared[k] = 0;
    const double least = *std::min_element(f.squared, f.squared + f.n);
    for (int move = 0; move < kMostMoves;) {
        weigh(fit.height, least, f);
        Equations e;
        accumulate(f, isQuadratic, e);
        if (!(isQuadratic ? solve<kTerms>(e, fit.terms) : solve<kLinear>(e, fit.terms))) {
            if (!isQuadratic) return false;
            isQuadratic = false;
            continue;
        }
        const double moved = fit.terms[0] - fit.height;
        fit.height = fit.terms[0];
        if (!(std::abs(fit.height) <= 1)) return false;
        if (std::abs(moved) < kAtRest) {
            fit.loose = looseness(f, fit.terms);
            return true;
        }
        ++move;
    }
    return false;
}

}  // namespace stipple::lod
