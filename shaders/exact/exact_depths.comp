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
    // What is read may be old, and then is larger: words only fall.
    const uint place = plane(at, 0u) + texel, depth = floatBitsToUint(d.centre.z), mark = plane(at, 2u);
    if (depth < texels[place]) atomicMin(texels[place], depth);
    if (texels[mark] != 0u) atomicMin(texels[mark], 0u);
}
