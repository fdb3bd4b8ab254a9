// Discs of few pixels to the sums of second surfaces.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel_disc.glsl"

void useDisc(KernelDisc p, ivec2 pixel) { addSecond(p.disc, p.side * p.rough, p.colour, p.surface, p.scale, p.kernel, p.range, pixel); }
#include "each_block.glsl"

void main() {
    eachOfBlock();
}
