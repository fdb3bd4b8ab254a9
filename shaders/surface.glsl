// The surface buffer, for the pass that fills it and for those that read it.
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"
#include "shared/surface.h"

layout(set = 0, binding = kSurfaceBinding, scalar) buffer SurfaceBufferBlock { SurfaceWords surfaceBuffer[]; };
