// One workgroup per block of 256 draw ids: discs of few pixels to the sums.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
#include "../left_discs.glsl"
layout(local_size_x = 256) in;

const int kMostPixels = 1024;

void addOwn() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= frame.firstBlock.of[kKindCurves]) return;
    const DrawBlock source = blocks[block];
    if (source.first + gl_LocalInvocationID.x >= nodes[source.node].count) return;
    DrawNode node;
    const uint id = block * kBlockLanes + gl_LocalInvocationID.x;
    const PointRecord r = recordOf(id, node);
    const Lens lens = frameLensHere();
    const WideDisc d = opaqueDisc(node, r, id);
    if (isSplatSeen(node, r, d, frame.nearPlane, lens) < 0.5) return;
    const float sigma = d.radius / kOpaqueSigmas;
    const EwaKernel k = ewaKernel(d, sigma, frame.kernelSupport, frame.lowPass, lens);
    WideDisc reach = d;
    reach.radius = sigma * frame.kernelSupport;
    if (k.isNear > 0.5 && reachesPicture(reach, frame) < 0.5) return;
    const PixelBox box = boxOf(d, k);
    const ivec2 size = box.last - box.first + 1;
    if (size.x <= 0 || size.y <= 0) return;
    const DepthRange range = depthRange(d, sigma, frame.kernelSupport, frame.lowPass, lens);
    if (size.x * size.y > kMostPixels) {
        if (discCount > kDiscCapacity) leave(id);  // else the list holds all
        return;
    }
    const vec3 colour = pointColour(node, r);
    const float scale = scaleOf(id, node);
    const TexelSurface surface = surfaceOf(id, node);
    for (int y = box.first.y; y <= box.last.y; ++y)
        for (int x = box.first.x; x <= box.last.x; ++x) addKernel(d, colour, surface, scale, k, range, ivec2(x, y));
}

void main() {
    leaveNone();
    addOwn();
    barrier();
    for (uint i = 0u; i < leftCount; ++i) {
        DrawNode node;
        const PointRecord r = recordOf(leftIds[i], node);
        const Lens lens = frameLensHere();
        const WideDisc d = opaqueDisc(node, r, leftIds[i]);
        const float sigma = d.radius / kOpaqueSigmas;
        const EwaKernel k = ewaKernel(d, sigma, frame.kernelSupport, frame.lowPass, lens);
        const DepthRange range = depthRange(d, sigma, frame.kernelSupport, frame.lowPass, lens);
        const vec3 colour = pointColour(node, r);
        const float scale = scaleOf(leftIds[i], node);
        const TexelSurface surface = surfaceOf(leftIds[i], node);
        const PixelBox box = boxOf(d, k);
        const int pixels = pixelsOf(box.first, box.last);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256)
            addKernel(d, colour, surface, scale, k, range, pixelOf(p, box.first, box.last));
    }
}
