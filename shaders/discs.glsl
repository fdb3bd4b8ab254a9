// The list of wide discs.
#extension GL_GOOGLE_include_directive : require
#include "bindings.glsl"
#include "shared/wide_disc.h"

layout(set = 0, binding = kDiscsBinding, scalar) coherent buffer DiscBlock {
    uint discCount;
    WideDisc discs[];
};

