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
SHARED_FN uint floatBitsToUint(float v) { return __builtin_bit_cast(uint, v); }
SHARED_FN float uintBitsToFloat(uint v) { return __builtin_bit_cast(float, v); }
// Plain structs: through GLM's unions compilers do not turn loops into SIMD.
struct vec2 {
    float x = 0, y = 0;
    vec2() = default;
    vec2(float vx, float vy) : x(vx), y(vy) {}
};
struct vec3 {
    float x = 0, y = 0, z = 0;
    vec3() = default;
    vec3(float vx, float vy, float vz) : x(vx), y(vy), z(vz) {}
    vec3(const glm::vec3& v) : x(v.x), y(v.y), z(v.z) {}
    operator glm::vec3() const { return {x, y, z}; }
    explicit operator glm::dvec3() const { return {x, y, z}; }
};
SHARED_FN float dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
using std::abs;
using std::exp2;
using std::log2;
using std::pow;
using std::sqrt;
SHARED_FN float min(float a, float b) { return b < a ? b : a; }
SHARED_FN float max(float a, float b) { return a < b ? b : a; }
SHARED_FN float floor(float a) { return std::floor(a); }
SHARED_END
// Of what must be rounded as it is written: kernels are compiled without fused multiplications.
#define SHARED_PRECISE
// A table of floats that GLSL reads from a buffer and C++ from its first argument.
#define SHARED_TABLE const float *environment,
#define SHARED_TABLE_USE environment,
// The same of what a layer of glass sees (optics.h): the environment, what lies behind it, its own back.
SHARED_BEGIN
struct SeenTables {
    const float *environment, *behind, *back;
};
SHARED_END
#define SHARED_SEEN const SeenTables &seen,
#define SHARED_SEEN_USE seen,
#define SHARED_SEEN_ENVIRONMENT seen.environment,
#define SHARED_SEEN_BEHIND(at) seen.behind[at]
#define SHARED_SEEN_BACK(at) seen.back[at]
#else
#define SHARED_PRECISE precise
#define SHARED_TABLE
#define SHARED_TABLE_USE
#define SHARED_SEEN
#define SHARED_SEEN_USE
#define SHARED_SEEN_ENVIRONMENT
#define SHARED_SEEN_BEHIND(at) behind[at]
#define SHARED_SEEN_BACK(at) back[at]
#define SHARED_BEGIN
#define SHARED_END
#define SHARED_FN
#endif

#endif
