// Discs of few pixels to second fronts.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel_disc.glsl"

void useDisc(KernelDisc p, ivec2 pixel) { offerBehind(p.disc, p.rough, p.kernel, p.range, pixel); }
#include "each_block.glsl"

void main() {
    eachOfBlock();
}
