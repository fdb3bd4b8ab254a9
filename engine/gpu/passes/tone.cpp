// Tone: part of the shader that shows the picture (shaders/tone), whatever else is.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass tonePass{overEveryPixel};

}  // namespace stipple::gpu
