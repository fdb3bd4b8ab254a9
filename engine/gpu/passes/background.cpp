// A picture behind everything, where the texels were: nobody reads those any more once there are surfaces. The shader
// that shows the picture takes it from there, whatever else it does.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass backgroundPass{[](Recording& f) { f.overPixels("background", "background"); }, true};

}  // namespace stipple::gpu
