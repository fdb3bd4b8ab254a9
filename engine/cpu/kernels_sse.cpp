#define STIPPLE_KERNELS kernels_sse
#define STIPPLE_KERNELS_NAME "sse"
#include "engine/cpu/kernels.inl"  // NOLINT(bugprone-suspicious-include)
