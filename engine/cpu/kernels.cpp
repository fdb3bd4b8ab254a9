#include "engine/cpu/kernels.h"

#include <array>
#include <cstdlib>
#include <string>

#include "engine/base/check.h"

namespace stipple::cpu {

extern const Kernels kernels_sse, kernels_avx2, kernels_avx512;

namespace {

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
        if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
            items.at(count++) = &kernels_avx2;
#endif
#if defined(STIPPLE_HAS_AVX512)
        if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
            __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw"))
            items.at(count++) = &kernels_avx512;
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
