#define STIPPLE_KERNELS kernels_avx2
#define STIPPLE_KERNELS_NAME "avx2"
#include "engine/cpu/kernels.inl"  // NOLINT(bugprone-suspicious-include)
