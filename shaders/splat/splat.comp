// One workgroup per block of 256 draw ids: each disc into every pixel whose ray meets it, and (of small ones, and of those that stand alone) into that of its centre,
// by 64-bit atomic minimum of (depth, id). Discs of many pixels go to the list, whose rows are shared out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
#include "../left_discs.glsl"
#include "../shared/splat_disc.h"
layout(local_size_x = 256) in;

const int kMostPixels = 1024;

void offer(int x, int y, float depth, uint id) {
    offerKey(uint(y) * frame.width + uint(x), visibilityKey(floatBitsToUint(depth), drawId(0u, id)));
}

// The disc of a lane of this block; radius -1: it is not drawn.
WideDisc discOf(uint block, uint lane) {
    WideDisc d;
    d.centre = d.normal = vec3(0.0);
    d.radius = -1.0;
    d.id = 0u;
    const DrawBlock source = blocks[block];
    const DrawNode node = nodes[source.node];
    if (source.first + lane >= node.count) return d;
    const PointRecord r = Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + lane];
    d = splatDisc(node, r, frame.supportScale, largestSplat(kFlagScattered, frame.focal, frame.height), block * kRecordsPerBlock + lane, frameLensHere());
    if (isSplatSeen(node, r, d, frame.nearPlane, frameLensHere()) * reachesPicture(d, frame) < 0.5) d.radius = -1.0;
    return d;
}

void offerMet(WideDisc d, ivec2 pixel) {
    const vec2 ray = (vec2(pixel) + 0.5 - frame.centre) * (1.0 / frame.focal);
    const float depth = discHit(d, pixelRay(frameLensHere(), ray.x, ray.y), frame.nearPlane).depth;
    if (depth < kNoDisc) offer(pixel.x, pixel.y, depth, d.id);
}

void offerOwn(uint block) {
    const WideDisc d = discOf(block, gl_LocalInvocationID.x);
    if (d.radius < 0.0) return;
    const CentrePixel c = ownPixel(d, standsAlone(d.id), frame);
    if (c.x >= 0) {
        const vec2 ray = (vec2(c.x, c.y) + 0.5 - frame.centre) * (1.0 / frame.focal);
        const PixelRay through = pixelRay(frameLensHere(), ray.x, ray.y);
        if (!(discHit(d, through, frame.nearPlane).depth < kNoDisc)) offer(c.x, c.y, ownDepth(d, through, frame), d.id);
    }
    const DiscBox box = discBox(d, frame);
    const int width = box.x.last - box.x.first + 1;
    const int height = box.y.last - box.y.first + 1;
    if (width <= 0 || height <= 0) return;
    if (width * height > kMostPixels) {
        uint place;
        TAKE_PLACE(discCount, place);
        if (place < kDiscCapacity) {
            discs[place] = d;
        } else {
            leave(gl_LocalInvocationID.x);
        }
        return;
    }
    for (int y = box.y.first; y <= box.y.last; ++y)
        for (int x = box.x.first; x <= box.x.last; ++x) offerMet(d, ivec2(x, y));
}

void main() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    leaveNone();
    if (block < frame.firstBlock.of[kKindCurves]) offerOwn(block);
    barrier();
    for (uint i = 0u; i < leftCount; ++i) {
        const WideDisc d = discOf(block, leftIds[i]);
        const DiscBox box = discBox(d, frame);
        const ivec2 first = ivec2(box.x.first, box.y.first), last = ivec2(box.x.last, box.y.last);
        const int pixels = pixelsOf(first, last);
        for (int p = int(gl_LocalInvocationID.x); p < pixels; p += 256) offerMet(d, pixelOf(p, first, last));
    }
}
