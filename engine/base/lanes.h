// Vectors of 32 bytes, which are eight values of 32 bits or four of 64 side by side, for loops in functions that are
// STIPPLE_WIDE.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace stipple {

inline constexpr size_t kLanes = 8;

using Lanes = int32_t __attribute__((vector_size(4 * kLanes)));
using Words = uint32_t __attribute__((vector_size(4 * kLanes)));
using Pairs = int64_t __attribute__((vector_size(4 * kLanes)));
using Floats = float __attribute__((vector_size(4 * kLanes)));

inline constexpr Lanes kLaneNumbers{0, 1, 2, 3, 4, 5, 6, 7};  ///< of each lane its index

/// One that may lie anywhere: what is dereferenced as a vector has to be aligned, and with clang an alias that said
/// otherwise lost its attributes.
template <typename Vector>
struct [[gnu::packed, gnu::may_alias]] Anywhere {
    Vector v;
};
/// Values [first, first + kLanes).
[[gnu::always_inline]] inline const Anywhere<Floats>& floatsAt(const float* values, size_t first) {
    return *reinterpret_cast<const Anywhere<Floats>*>(values + first);
}
[[gnu::always_inline]] inline Anywhere<Floats>& floatsAt(float* values, size_t first) {
    return *reinterpret_cast<Anywhere<Floats>*>(values + first);
}

// Masks have of each lane all bits or none.
/// Is any lane set?
[[gnu::always_inline]] inline bool isAny(const Lanes& mask) {
    static_assert(kLanes == 8);
    const auto pairs = reinterpret_cast<Pairs>(mask);
    return (pairs[0] | pairs[1] | pairs[2] | pairs[3]) != 0;
}
/// 0 where the mask is not set.
[[gnu::always_inline]] inline void keepOnly(Floats& values, const Lanes& mask) {
    values = reinterpret_cast<Floats>(reinterpret_cast<Lanes>(values) & mask);
}
/// Of all lanes.
template <typename Vector>
[[gnu::always_inline]] inline auto leastOf(const Vector& values) {
    auto least = values[0];
    for (size_t k = 1; k < kLanes; ++k) least = std::min(least, values[k]);
    return least;
}
[[gnu::always_inline]] inline int32_t mostOf(const Lanes& values) {
    int32_t most = values[0];
    for (size_t k = 1; k < kLanes; ++k) most = std::max(most, values[k]);
    return most;
}
/// Of values that are not negative; all at once only where files are compiled with -fno-math-errno.
[[gnu::always_inline]] inline void takeRoots(Floats& values) {
    float roots[kLanes];  // NOLINT: a vector
    for (size_t k = 0; k < kLanes; ++k) roots[k] = std::sqrt(values[k]);
    values = floatsAt(roots, 0).v;
}

}  // namespace stipple
