#include "engine/cpu/kernels.h"

#include <cstdlib>
#include <string>

namespace stipple::cpu {

#if defined(__x86_64__)
extern const Kernels kernels_sse, kernels_avx2, kernels_avx512;
#else
extern const Kernels kernels_sse;
#endif

const Kernels* const* availableKernels(size_t& count) {
    static const struct List {
        std::array<const Kernels*, 3> items{&kernels_sse};
        size_t count = 1;
        List() {
#if defined(__x86_64__)
            __builtin_cpu_init();
            if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) items.at(count++) = &kernels_avx2;
            if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw"))
                items.at(count++) = &kernels_avx512;
#endif
        }
    } list;
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
