// One workgroup per block of 256 draw ids: discs to the fronts of pixels; those of many pixels to the list.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
#include "../left_discs.glsl"
layout(local_size_x = 256) in;

const int kMostPixels = 1024;

void offerOwn() {
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
    const float rough = roughness(d, r);
    const CentrePixel c = centrePixel(d, frame);
    if (c.x >= 0) offerFront(d, rough, k, range, ivec2(c.x, c.y), true);
    if (size.x * size.y > kMostPixels) {
        uint place;
        TAKE_PLACE(discCount, place);
        if (place < kDiscCapacity) {
            discs[place] = d;
        } else {
            leave(id);
        }
        return;
    }
    for (int y = box.first.y; y <= box.last.y; ++y)
        for (int x = box.first.x; x <= box.last.x; ++x) offerFront(d, rough, k, range, ivec2(x, y), false);
}

void main() {
    leaveNone();
    offerOwn();
    barrier();
    for (uint i = 0u; i < leftCount; ++i) {
        DrawNode node;
        const PointRecord r = recordOf(leftIds[i], node);
        const Lens lens = frameLensHere();
        const WideDisc d = opaqueDisc(node, r, leftIds[i]);
        const float sigma = d.radius / kOpaqueSigmas;
        const EwaKernel k = ewaKernel(d, sigma, frame.kernelSupport, frame.lowPass, lens);
        const DepthRange range = depthRange(d, sigma, frame.kernelSupport, frame.lowPass, lens);
        const PixelBox box = boxOf(d, k);
        const int pixels = pixelsOf(box.first, box.last);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256)
            offerFront(d, roughness(d, r), k, range, pixelOf(p, box.first, box.last), false);
    }
}
