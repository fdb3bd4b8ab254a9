// Fog: part of the shader that shows the picture (shaders/fog), whatever else is.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass fogPass{overEveryPixel};

}  // namespace stipple::gpu
