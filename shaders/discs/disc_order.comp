// One workgroup sorts the list of wide discs by their ids (bitonic, Batcher 1968): sums over it are rounded, and must
// not hang on the order in which threads came.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint count = min(discCount, kDiscCapacity);
    uint size = 1u;
    while (size < count) size <<= 1;
    for (uint i = count + gl_LocalInvocationID.x; i < size; i += 256u) discs[i].id = 0xffffffffu;
    memoryBarrierBuffer();
    barrier();
    for (uint run = 2u; run <= size; run <<= 1)
        for (uint apart = run >> 1; apart > 0u; apart >>= 1) {
            for (uint i = gl_LocalInvocationID.x; i < size; i += 256u) {
                const uint other = i ^ apart;
                if (other < i) continue;
                const bool isUp = (i & run) == 0u;
                if ((discs[i].id > discs[other].id) != isUp) continue;
                const WideDisc d = discs[i];
                discs[i] = discs[other];
                discs[other] = d;
            }
            memoryBarrierBuffer();
            barrier();
        }
}
