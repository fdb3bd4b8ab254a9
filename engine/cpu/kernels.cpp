#include "engine/cpu/kernels.h"

#include <array>
#include <cstdlib>
#include <string>

#include "engine/base/check.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace stipple::cpu {

extern const Kernels kernels_sse, kernels_avx2, kernels_avx512;

namespace {

#if defined(__x86_64__)
/// All that -march=x86-64-v3 lets the compiler use, which -v4 does, too (CMakeLists.txt), whatever kernels ask for
/// themselves. (By cpuid what __builtin_cpu_supports has no name for in every compiler.)
[[maybe_unused]] bool hasV3() {
    unsigned a = 0, b = 0, basic = 0, extended = 0, d = 0;
    if (__get_cpuid(1, &a, &b, &basic, &d) == 0 || __get_cpuid(0x80000001, &a, &b, &extended, &d) == 0) return false;
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
           __builtin_cpu_supports("bmi2") && (basic & bit_MOVBE) != 0 && (basic & bit_F16C) != 0 &&
           (extended & bit_LZCNT) != 0;
}
[[maybe_unused]] bool hasV4() {
    return hasV3() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
}
#endif

/// Those that were compiled, of a processor that has them; the best comes last.
struct List {
    std::array<const Kernels*, 3> items{};
    size_t count = 0;
    List() {
#if defined(__x86_64__)
        __builtin_cpu_init();
#endif
#if defined(STIPPLE_HAS_SSE)
        items.at(count++) = &kernels_sse;
#endif
#if defined(STIPPLE_HAS_AVX2)
        if (hasV3()) items.at(count++) = &kernels_avx2;
#endif
#if defined(STIPPLE_HAS_AVX512)
        if (hasV4()) items.at(count++) = &kernels_avx512;
#endif
        STIPPLE_CHECK(count > 0, "this program was compiled for a processor with more instructions (STIPPLE_KERNELS)");
    }
};

}  // namespace

const Kernels* const* availableKernels(size_t& count) {
    static const List list;
    count = list.count;
    return list.items.data();
}

const Kernels& bestKernels() {
    size_t count = 0;
    const Kernels* const* all = availableKernels(count);
    if (const char* wanted = std::getenv("STIPPLE_SIMD"))
        for (size_t i = 0; i < count; ++i)
            if (std::string(wanted) == all[i]->name) return *all[i];
    return *all[count - 1];
}

}  // namespace stipple::cpu
