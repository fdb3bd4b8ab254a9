// Eight values of 32 bits side by side, for loops in functions that are STIPPLE_WIDE.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace stipple {

inline constexpr size_t kLanes = 8;

using Lanes = int32_t __attribute__((vector_size(4 * kLanes)));
using Words = uint32_t __attribute__((vector_size(4 * kLanes)));
using Pairs = int64_t __attribute__((vector_size(4 * kLanes)));
using Floats = float __attribute__((vector_size(4 * kLanes)));

inline constexpr Lanes kNumbers{0, 1, 2, 3, 4, 5, 6, 7};

/// One that may lie anywhere: what is dereferenced as a vector has to be aligned, and clang knows no other vectors.
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

/// Of each lane all bits or none.
[[gnu::always_inline]] inline bool isAny(const Lanes& mask) {
    const auto pairs = reinterpret_cast<Pairs>(mask);
    return (pairs[0] | pairs[1] | pairs[2] | pairs[3]) != 0;
}
/// Of values that are not negative.
[[gnu::always_inline]] inline void takeRoots(Floats& values) {
    float roots[kLanes];  // NOLINT: a vector
    for (size_t k = 0; k < kLanes; ++k) roots[k] = std::sqrt(values[k]);
    values = floatsAt(roots, 0).v;
}

}  // namespace stipple
