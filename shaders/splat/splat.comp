// One workgroup per block of 256 draw ids: each disc into every pixel whose ray meets it, and into that of its centre,
// by 64-bit atomic minimum of (depth, id). Discs of many pixels go to the list, whose rows are shared out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
#include "../shared/splat_disc.h"
layout(local_size_x = 256) in;

const int kMostPixels = 1024;

void offer(int x, int y, float depth, uint id) {
    atomicMin(visibility[uint(y) * frame.width + uint(x)], visibilityKey(floatBitsToUint(depth), drawId(0u, id)));
}

void main() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= frame.firstBlock.curves) return;
    const DrawBlock source = blocks[block];
    const DrawNode node = nodes[source.node];
    const uint index = source.first + gl_LocalInvocationID.x;
    if (index >= node.count) return;
    const PointRecord r = Records(uvec2(node.addressLow, node.addressHigh)).records[index];
    const WideDisc d = splatDisc(node, r, frame.supportScale, largestSplat(kFlagScattered, frame.focal, frame.height), block * kRecordsPerBlock + gl_LocalInvocationID.x, frameLensHere());
    if (isSplatSeen(node, r, d, frame.nearPlane, frameLensHere()) * reachesPicture(d, frame) < 0.5) return;
    const float inverseFocal = 1.0 / frame.focal;
    const CentrePixel c = centrePixel(d, frame);
    if (c.x >= 0) {
        const vec2 ray = (vec2(c.x, c.y) + 0.5 - frame.centre) * inverseFocal;
        if (!(discHit(d, pixelRay(frameLensHere(), ray.x, ray.y), frame.nearPlane).depth < kNoDisc)) offer(c.x, c.y, d.centre.z, d.id);
    }
    const DiscBox box = discBox(d, frame);
    const int width = box.x.last - box.x.first + 1;
    const int height = box.y.last - box.y.first + 1;
    if (width <= 0 || height <= 0) return;
    if (width * height > kMostPixels) {
        const uint place = atomicAdd(discCount, 1u);
        if (place < kDiscCapacity) {
            discs[place] = d;
            return;
        }
    }
    for (int y = box.y.first; y <= box.y.last; ++y)
        for (int x = box.x.first; x <= box.x.last; ++x) {
            const vec2 ray = (vec2(x, y) + 0.5 - frame.centre) * inverseFocal;
            const float depth = discHit(d, pixelRay(frameLensHere(), ray.x, ray.y), frame.nearPlane).depth;
            if (depth < kNoDisc) offer(x, y, depth, d.id);
        }
}
