// Shadows: part of the shader that shows lit surfaces (shaders/shadow).
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass shadowPass{overEveryPixel};

}  // namespace stipple::gpu
