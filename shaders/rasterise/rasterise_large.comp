// Workgroup (x, y) fills the rows of band y of every 64th large triangle: one over the whole image is work for all.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../mesh.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint count = min(largeCount, kLargeCapacity);
    const int firstRow = int(gl_WorkGroupID.y) * int(kBandRows);
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        const LargeTriangle t = large[i];
        const int x0 = max((min(t.x0, min(t.x1, t.x2)) + 127) >> 8, 0);
        const int x1 = min((max(t.x0, max(t.x1, t.x2)) - 128) >> 8, int(frame.width) - 1);
        const int y0 = max((min(t.y0, min(t.y1, t.y2)) + 127) >> 8, firstRow);
        const int y1 = min((max(t.y0, max(t.y1, t.y2)) - 128) >> 8, min(firstRow + int(kBandRows), int(frame.height)) - 1);
        const int width = x1 - x0 + 1;
        if (width <= 0 || y1 < y0) continue;
        const int pixels = width * (y1 - y0 + 1);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256) {
            const int x = x0 + p % width, y = y0 + p / width;
            float inverseDepth;
            if (isCovered(t, x, y, inverseDepth)) offer(x, y, inverseDepth, drawId(stepInfo.firstBlock, t.id));
        }
    }
}
