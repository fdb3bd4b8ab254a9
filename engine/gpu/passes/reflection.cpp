// Reflections of the screen: a dispatch over the picture (shaders/reflection), whose results the shader that shows lit
// surfaces finds where the texels were.
#include "engine/gpu/passes/passes.h"

namespace stipple::gpu {

constinit const GpuPass reflectionPass{
    [](Recording& f) { f.overPixels("reflection", f.draws().isShadowed ? "shadow_reflection" : "reflection"); }};

}  // namespace stipple::gpu
