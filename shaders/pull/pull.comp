// Four texels of a level to one of the next coarser level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
layout(local_size_x = 64) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= stepInfo.coarseWidth || pixel.y >= stepInfo.coarseHeight) return;
    if (stepInfo.level + 1u >= levelCount()) return;
    const ivec2 c = ivec2(pixel) * 2;
    const Texel t = pullTexels(loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, c.x, c.y),
                               loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, c.x + 1, c.y),
                               loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, c.x, c.y + 1),
                               loadTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, c.x + 1, c.y + 1),
                               exp2(float(stepInfo.level)), frameLensHere());
    storeTexel(stepInfo.coarse, stepInfo.coarseWidth, stepInfo.coarseHeight, pixel, t);
}
