// Refines one level from the next coarser one, in place.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
layout(local_size_x = kLevelTile, local_size_y = kLevelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= stepInfo.fineWidth || pixel.y >= stepInfo.fineHeight) return;
    const Texel own = loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, int(pixel.x), int(pixel.y));
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, pushedTexel(ivec2(pixel), own));
}
