// The least depth of the discs of each texel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "exact.glsl"
layout(local_size_x = 256) in;

void main() {
    WideDisc d;
    LevelPlane at;
    uint texel;
    if (!discHere(d) || !texelOf(d, at, texel)) return;
    atomicMin(texels[plane(at, 0u) + texel], floatBitsToUint(d.centre.z));
    atomicMin(texels[plane(at, 2u)], 0u);
}
