// Workgroup (x, y) fills the rows of band y of every 64th filled curve: one over the whole image is work for all.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../curves.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint count = min(wideCount, kWideCapacity);
    const int firstRow = int(gl_WorkGroupID.y) * int(kBandRows);
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        const FilledCurve s = wide[i];
        const int x0 = s.box.x;
        const int x1 = s.box.z;
        const int y0 = max(s.box.y, firstRow);
        const int y1 = min(s.box.w, firstRow + int(kBandRows) - 1);
        const int width = x1 - x0 + 1;
        if (width <= 0 || y1 < y0) continue;
        const int pixels = width * (y1 - y0 + 1);
        const Ribbon ribbon = ribbonOfWide(s);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256) offerWide(s, ribbon, x0 + p % width, y0 + p / width);
    }
}
