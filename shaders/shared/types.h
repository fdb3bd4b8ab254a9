// The one place that knows whether C++ or GLSL is reading: everything else in this folder is the common subset.
#ifndef STIPPLE_SHARED_TYPES_H
#define STIPPLE_SHARED_TYPES_H

#ifdef __cplusplus
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#define SHARED_BEGIN namespace stipple::shared {
#define SHARED_END }
// static: the kernels compile these functions once per instruction set, and the linker must not merge the copies.
#define SHARED_FN [[maybe_unused, gnu::always_inline]] static inline
SHARED_BEGIN
using uint = std::uint32_t;
using glm::dot;
using glm::floatBitsToUint;
using glm::uintBitsToFloat;
using glm::uvec2;
using glm::vec2;
using glm::vec3;
using std::abs;
using std::exp2;
using std::log2;
using std::pow;
using std::sqrt;
SHARED_FN float min(float a, float b) { return b < a ? b : a; }
SHARED_FN float max(float a, float b) { return a < b ? b : a; }
SHARED_FN float floor(float a) { return std::floor(a); }
SHARED_END
#else
#define SHARED_BEGIN
#define SHARED_END
#define SHARED_FN
#endif

#endif
