// Floats of which nothing is known (they stand in somebody's file) become integers, bytes and smaller floats here. A
// plain cast of what the target does not hold is undefined behaviour.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace stipple {

/// Towards zero; the nearest that T holds where it does not hold `v`; 0 of what is no number.
template <typename T, typename F>
constexpr T toWhole(F v) {
    static_assert(std::is_integral_v<T> && std::is_floating_point_v<F>);
    // Powers of two, so that they are exact: the largest T itself may be none of F.
    const F end = F{2} * static_cast<F>(std::numeric_limits<T>::max() / 2 + 1);
    const F least = std::is_signed_v<T> ? -end : F{0};
    if (!(v > least)) return v <= least ? std::numeric_limits<T>::min() : T{0};
    return v < end ? static_cast<T>(v) : std::numeric_limits<T>::max();
}

/// 0 to 1 as 0 to 255, to the nearest; what lies beyond is at the ends, what is no number is 0.
template <typename F>
constexpr uint32_t unitToByte(F v) {
    return toWhole<uint32_t>(v >= F{1} ? F{255} : v > F{0} ? v * F{255} + F{0.5} : F{0});
}

/// To the nearest; infinite where no float is near.
inline float toFloat(double v) {
    if (std::abs(v) <= double{std::numeric_limits<float>::max()} || std::isnan(v)) return static_cast<float>(v);
    return static_cast<float>(std::copysign(std::numeric_limits<double>::infinity(), v));
}

/// All three parts are numbers. (Their sum may be none though they are.)
template <typename V>
bool isFinite(const V& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Does it have a direction: finite, and not zero, however short or long?
template <typename V>
bool hasDirection(const V& v) {
    return isFinite(v) && (v.x != 0 || v.y != 0 || v.z != 0);
}

/// The same direction, its largest part 1/2 to 1: of it lengths and products can be computed. `v`: hasDirection. Scaled
/// by a power of two, so that nothing is rounded but what is 2^-100 of the largest.
template <typename V>
V withoutScale(const V& v) {
    int exponent = 0;
    (void)std::frexp(std::fmax(std::fmax(std::abs(v.x), std::abs(v.y)), std::abs(v.z)), &exponent);
    return V(std::ldexp(v.x, -exponent), std::ldexp(v.y, -exponent), std::ldexp(v.z, -exponent));
}

}  // namespace stipple
