// Workgroup (x, y) fills the rows of band y of every 64th wide disc: one over the whole image is work for all.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint count = min(discCount, kDiscCapacity);
    const int firstRow = int(gl_WorkGroupID.y) * int(kBandRows);
    const float inverseFocal = 1.0 / frame.focal;
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        const WideDisc d = discs[i];
        const DiscBox box = discBox(d, frame);
        const PixelRange x = box.x;
        const PixelRange all = box.y;
        const ivec2 y = ivec2(max(all.first, firstRow), min(all.last, firstRow + int(kBandRows) - 1));
        const int width = x.last - x.first + 1;
        if (width <= 0 || y.y < y.x) continue;
        const int pixels = width * (y.y - y.x + 1);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256) {
            const ivec2 at = ivec2(x.first + p % width, y.x + p / width);
            const vec2 ray = (vec2(at) + 0.5 - frame.centre) * inverseFocal;
            const float depth = discHit(d, pixelRay(frameLensHere(), ray.x, ray.y), frame.nearPlane).depth;
            if (depth < kNoDisc) offerKey(uint(at.y) * frame.width + uint(at.x), visibilityKey(floatBitsToUint(depth), drawId(stepInfo.firstBlock, d.id)));
        }
    }
}
