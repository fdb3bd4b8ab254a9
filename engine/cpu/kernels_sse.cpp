#define STIPPLE_KERNELS kernels_sse
#define STIPPLE_KERNELS_ORTHOGRAPHIC kernels_sse_orthographic
#define STIPPLE_ORTHOGRAPHIC false
#define STIPPLE_KERNELS_NAME "sse"
#include "engine/cpu/kernels.inl"  // NOLINT(bugprone-suspicious-include)
