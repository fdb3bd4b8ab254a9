// Eye-dome lighting: a dispatch over the picture (shaders/edl).
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass edlPass{overEveryPixel};

}  // namespace stipple::gpu
