// The winner of each pixel to a texel of level 0; measures the largest splat.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
#include "../shared/splat_size.h"
layout(local_size_x = 64) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    Texel t;
    t.depth = 0.0;
    t.radius = 0.0;
    t.thickness = 0.0;
    t.offset = vec2(0.0);
    t.normalPerp = vec2(0.0);
    t.colour = vec3(0.0);
    t.isRound = 0.0;
    t.axis = vec2(0.0);
    const uint64_t key = visibility[pixel.y * frame.width + pixel.x];
    if ((uint(key) & 0xe0000000u) == 0u) {  // a point; triangles come later, and nothing has all bits set
        const uint id = uint(key) & 0x1fffffffu;
        const DrawBlock source = blocks[id / kRecordsPerBlock];
        const DrawNode node = nodes[source.node];
        const PointRecord r = Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + id % kRecordsPerBlock];
        const vec3 c = node.base + node.axisX * float(recordX(r)) + node.axisY * float(recordY(r)) + node.axisZ * float(recordZ(r));
        const Lens lens = frameLensHere();
        vec3 n = -normalize(sightTo(lens, c));
        if ((recordFlags(r) & kFlagNoNormal) == 0u) n = nodeDirection(node, octDecode(r.normal));
        const float radius = min(node.edge * radiusFraction(recordRadiusCode(r)) * frame.supportScale, lensDepth(lens, c.z) * largestSplat(recordFlags(r), frame.focal, frame.height));
        t = texelFromSplat(c, n, radius, lens, frame.minimumRadius);
        if ((recordFlags(r) & kFlagLoose) != 0u) t.thickness = kLeafThickness * t.radius;
        const float scale = frame.focal / lensDepth(lens, c.z);
        t.offset = vec2(c.x * scale + (frame.centre.x - 0.5) - float(pixel.x), c.y * scale + (frame.centre.y - 0.5) - float(pixel.y));
        t.colour = pointColour(node, r);
        atomicMax(largestRadiusBits, floatBitsToUint(t.radius));
    }
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
}
