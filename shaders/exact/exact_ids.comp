// Of the discs of a texel's least depth, the least id.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "exact.glsl"
layout(local_size_x = 256) in;

void main() {
    WideDisc d;
    LevelPlane at;
    uint texel;
    if (!discHere(d) || !texelOf(d, at, texel)) return;
    if (texels[plane(at, 0u) + texel] != floatBitsToUint(d.centre.z)) return;
    const uint place = plane(at, 1u) + texel;
    if (d.id < texels[place]) atomicMin(texels[place], d.id);  // what is read may be old, and then is larger
}
