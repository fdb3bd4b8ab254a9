// The tail of the pyramid (pyramid_tail.h) in one workgroup: from level stepInfo.level, of few texels, to the coarsest and back. What
// a thread reads of a level others have written: a barrier after each.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TEXELS coherent
#include "../bindings.glsl"
layout(local_size_x = 256) in;

void main() {
    PyramidLevel places[kTailLevels];
    const uint words = kTexelWords + (frame.hasMaterials != 0u ? 1u : 0u);
    const uint levels = levelCount();
    uint level = stepInfo.level;
    uint last = 0u;
    PyramidLevel fine = PyramidLevel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight);
    places[0] = fine;
    while (level + 1u < levels && (fine.width > 1u || fine.height > 1u)) {
        const PyramidLevel coarse = PyramidLevel(fine.offset + words * fine.width * fine.height, (fine.width + 1u) / 2u, (fine.height + 1u) / 2u);
        for (uint i = gl_LocalInvocationID.x; i < coarse.width * coarse.height; i += 256u) {
            const uvec2 pixel = uvec2(i % coarse.width, i / coarse.width);
            storeTexel(coarse.offset, coarse.width, coarse.height, pixel, pulledFrom(fine, level, ivec2(pixel)));
        }
        memoryBarrierBuffer();
        barrier();
        ++level;
        ++last;
        fine = coarse;
        places[last] = fine;
    }
    while (last > 0u && level > 1u) {  // the last push fills the surface buffer
        const PyramidLevel coarse = places[last];
        --level;
        --last;
        fine = places[last];
        for (uint i = gl_LocalInvocationID.x; i < fine.width * fine.height; i += 256u) {
            const uvec2 pixel = uvec2(i % fine.width, i / fine.width);
            const Texel own = loadTexel(fine.offset, fine.width, fine.height, int(pixel.x), int(pixel.y));
            storeTexel(fine.offset, fine.width, fine.height, pixel, pushedFrom(coarse, level, ivec2(pixel), own));
        }
        memoryBarrierBuffer();
        barrier();
    }
}
