// One workgroup per block of 256 draw ids, eight a thread: each record to its pixel, by 64-bit atomic minimum of (depth,
// draw id).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
#include "../shared/splat_size.h"
layout(local_size_x = 32) in;  // what was fastest on the one card at hand (tests/bench/results/2026-11-27-gpu-h100.md)
const uint kThreads = 32u;

void project(DrawNode node, PointRecord r, uint block, uint lane) {
    const bool fine = recordErrorCode(r) <= node.errorCode || (node.octantMask >> recordOctant(r) & 1u) != 0u;
    if (!fine) return;
    const vec3 c = node.base + node.axisX * float(recordX(r)) + node.axisY * float(recordY(r)) + node.axisZ * float(recordZ(r));
    const Lens lens = frameLensHere();
    const vec3 sight = sightTo(lens, c);
    const bool isOneSided = (recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) == 0u;
    if (stepInfo.hasWideDiscs != 0u && (node.octantMask & kNodeWide) != 0u &&
        isWideDisc(recordFlags(r), c.z, node.edge * frame.supportScale * radiusFractionFast(recordRadiusCode(r)), wideRadius(frame.width, frame.height) / frame.focal, frame.nearPlane, lens) > 0.5) {
        if (isOneSided && !(dot(nodeNormal(node, octDirection(r.normal)), sight) < 0.0)) return;
        const WideDisc d = wideDisc(node, r, frame.supportScale, block * kRecordsPerBlock + lane, lens);
        if (reachesPicture(d, frame) < 0.5) return;
        uint place;
        TAKE_PLACE(discCount, place);
        if (place < kDiscCapacity) {
            discs[place] = d;
            return;
        }
    }
    if (!(c.z > frame.nearPlane)) return;
    const float scale = frame.focal / lensDepth(lens, c.z);
    float key = c.z;
    vec2 p = vec2(c.x * scale + frame.centre.x, c.y * scale + frame.centre.y);
    if (!(p.x >= 0.0 && p.y >= 0.0 && p.x < float(frame.width) && p.y < float(frame.height))) {
        if (stepInfo.hasPyramid == 0u) return;
        const float cap = lensDepth(lens, c.z) * largestSplat(recordFlags(r), frame.focal, frame.height);
        const float radius = max(min(node.edge * radiusFractionFast(recordRadiusCode(r)) * frame.supportScale, cap) * scale, frame.minimumRadius);
        const SplatPixel s = splatPixel(p.x, p.y, sight.x, sight.y, sight.z, radius, float(frame.width), float(frame.height));
        if (s.x < 0) return;
        p = vec2(float(s.x), float(s.y));
        key = c.z + s.farther * radius / scale;
    }
    if (isOneSided && !(dot(nodeNormal(node, octDirection(r.normal)), sight) < 0.0)) return;
    offerKey(uint(p.y) * frame.width + uint(p.x), visibilityKey(floatBitsToUint(key), drawId(block, lane)));
}

void main() {
    const uint block = gl_WorkGroupID.x + gl_WorkGroupID.y * kGroupsPerDimension;
    if (block >= frame.firstBlock.of[kKindCurves]) return;
    const DrawBlock source = blocks[block];
    const DrawNode node = nodes[source.node];
    if (stepInfo.onlySmooth != 0u && (node.octantMask & kNodeSmooth) == 0u) return;
    Records from = Records(uvec2(node.addressLow, node.addressHigh));
    for (uint lane = gl_LocalInvocationID.x; lane < kRecordsPerBlock && source.first + lane < node.count; lane += kThreads)
        project(node, from.records[source.first + lane], block, lane);
}
