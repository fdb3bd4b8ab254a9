// Workgroup (x, y) fills the rows of band y of every 64th large splat.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../patch_splats.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint count = min(largeCount, kLargeCapacity);
    const int firstRow = int(gl_WorkGroupID.y) * int(kBandRows);
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        PatchSplat s;
        if (!splatOf(large[i].id, s)) continue;
        const int y0 = max(s.box.y, firstRow), y1 = min(s.box.w, firstRow + int(kBandRows) - 1);
        const int width = s.box.z - s.box.x + 1;
        if (width <= 0 || y1 < y0) continue;
        const int pixels = width * (y1 - y0 + 1);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256) offerSplat(s, s.box.x + p % width, y0 + p / width);
    }
}
