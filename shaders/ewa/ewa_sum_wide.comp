// The same for the list of discs of many pixels: workgroup (x, y) works on the rows of band y of every 64th of them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
layout(local_size_x = 256) in;

void main() {
    const uint count = discCount <= kDiscCapacity ? discCount : 0u;
    const int firstRow = int(gl_WorkGroupID.y) * int(kBandRows);
    const Lens lens = frameLensHere();
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        const WideDisc d = discs[i];
        DrawNode node;
        const PointRecord r = recordOf(d.id, node);
        const float sigma = d.radius / kOpaqueSigmas;
        const EwaKernel k = ewaKernel(d, sigma, frame.kernelSupport, frame.lowPass, lens);
        const DepthRange range = depthRange(d, sigma, frame.kernelSupport, frame.lowPass, lens);
        const PixelBox box = boxOf(d, k);
        const ivec2 rows = ivec2(max(box.first.y, firstRow), min(box.last.y, firstRow + int(kBandRows) - 1));
        const int width = box.last.x - box.first.x + 1;
        if (width <= 0 || rows.y < rows.x) continue;
        const int pixels = width * (rows.y - rows.x + 1);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256) {
            const ivec2 at = ivec2(box.first.x + p % width, rows.x + p / width);
            addKernel(d, pointColour(node, r), surfaceOf(d.id, node), scaleOf(d.id, node), k, range, at);
        }
    }
}
