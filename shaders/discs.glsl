// The list of wide discs.
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"
#include "shared/wide_disc.h"

layout(set = 0, binding = 18, scalar) buffer DiscBlock {
    uint discCount;
    WideDisc discs[];
};
const uint kDiscCapacity = 65536u;  // what is beyond is drawn as an ellipse a texel
