#define STIPPLE_KERNELS kernels_avx512_orthographic
#define STIPPLE_KERNELS_ORTHOGRAPHIC kernels_avx512_orthographic
#define STIPPLE_ORTHOGRAPHIC true
#define STIPPLE_KERNELS_NAME "avx512"
#include "engine/cpu/kernels.inl"  // NOLINT(bugprone-suspicious-include)
