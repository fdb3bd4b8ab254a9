// Four texels of a level to one of the next coarser level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
layout(local_size_x = kLevelTile, local_size_y = kLevelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= stepInfo.coarseWidth || pixel.y >= stepInfo.coarseHeight) return;
    const PyramidLevel fine = PyramidLevel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight);
    storeTexel(stepInfo.coarse, stepInfo.coarseWidth, stepInfo.coarseHeight, pixel, pulledFrom(fine, stepInfo.level, ivec2(pixel)));
}
