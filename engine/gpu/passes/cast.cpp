// What lights that cast shadows meet: a dispatch over the picture (shaders/cast).
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass castPass{overEveryPixel};

}  // namespace stipple::gpu
