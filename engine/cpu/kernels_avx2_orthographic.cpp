#define STIPPLE_KERNELS kernels_avx2_orthographic
#define STIPPLE_KERNELS_ORTHOGRAPHIC kernels_avx2_orthographic
#define STIPPLE_ORTHOGRAPHIC true
#define STIPPLE_KERNELS_NAME "avx2"
#include "engine/cpu/kernels.inl"  // NOLINT(bugprone-suspicious-include)
