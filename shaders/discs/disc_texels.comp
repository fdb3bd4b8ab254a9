// Texels of level 0 where wide discs are in front: the mean of those about the front one's depth.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../discs.glsl"
layout(local_size_x = 64) in;

PointRecord recordOf(uint id, out DrawNode node) {
    const DrawBlock source = blocks[id / kRecordsPerBlock];
    node = nodes[source.node];
    return Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + id % kRecordsPerBlock];
}

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint64_t key = visibility[pixel.y * frame.width + pixel.x];
    if ((uint(key) & ~kPointMask) != kKindDisc) return;
    const vec2 ray = (vec2(pixel) + 0.5 - frame.centre) * (1.0 / frame.focal);
    const float depth = uintBitsToFloat(uint(key >> 32));
    DrawNode node;
    const uint frontId = uint(key) & kPointMask;
    const PointRecord front = recordOf(frontId, node);
    const float apart = depthShared(wideDisc(node, front, frame.supportScale, frontId), ray.x, ray.y);
    float weight = 0.0;
    float inverseDepth = 0.0;
    vec3 n = vec3(0.0);
    vec3 colour = vec3(0.0);
    const uint count = min(discCount, kDiscCapacity);
    for (uint i = 0; i < count; ++i) {
        const WideDisc d = discs[i];
        const DiscHit hit = discHit(d, ray.x, ray.y, frame.nearPlane);
        const float w = discWeight(hit, depth, apart);
        if (w == 0.0) continue;
        const PointRecord r = recordOf(d.id & kPointMask, node);
        weight += w;
        inverseDepth += w / hit.depth;
        n += d.normal * (dot(d.normal, d.centre) > 0.0 ? -w : w);
        colour += w * pointColour(node, r);
    }
    Texel t;
    t.depth = weight / inverseDepth;
    t.radius = kExactRadius;
    t.thickness = (recordFlags(front) & kFlagLoose) != 0u ? kLeafThickness * kExactRadius : kExactRadius;
    t.offset = vec2(0.0);
    t.normalPerp = perpFromNormal(normalize(n), viewDirection(ray.x * frame.focal, ray.y * frame.focal, frame.focal));
    t.colour = colour / weight;
    t.isRound = 0.0;
    t.axis = vec2(0.0);
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
}
