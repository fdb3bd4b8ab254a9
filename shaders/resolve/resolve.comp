// The winner of each pixel to a texel of level 0; measures the largest splat.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../bindings.glsl"
#include "../shared/ewa.h"
#include "../shared/splat_size.h"
#include "../shared/splat_disc.h"
layout(set = 0, binding = kFilteredBinding, scalar) readonly buffer FilteredBlock { FilteredPixel filtered[]; };
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

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
    t.surface = noSurface();
    const uint64_t key = visibility[pixel.y * frame.width + pixel.x];
    if (isPointKey(key, frame.firstBlock)) {  // other kinds come later
        const DrawBlock source = blocks[keyBlock(key)];
        const DrawNode node = nodes[source.node];
        const PointRecord r = Records(uvec2(node.addressLow, node.addressHigh)).records[source.first + keyLane(key)];
        const vec3 c = node.base + node.axisX * float(recordX(r)) + node.axisY * float(recordY(r)) + node.axisZ * float(recordZ(r));
        const Lens lens = frameLensHere();
        vec3 n = -normalize(sightTo(lens, c));
        if ((recordFlags(r) & kFlagNoNormal) == 0u) n = nodeUnitNormal(node, octDecode(r.normal));
        const TexelSurface surface = surfaceOfPoint(frame.hasMaterials != 0u ? materialOf(node, source.first + keyLane(key)) : kPlainPoint);
        const float radius = min(node.edge * radiusFraction(recordRadiusCode(r)) * frame.supportScale, lensDepth(lens, c.z) * largestSplat(recordFlags(r), frame.focal, frame.height));
        if (stepInfo.exactPoints != 0u) {  // no splat, but what the pixel shows
            const vec3 v = viewDirection(float(pixel.x) + 0.5 - frame.centre.x, float(pixel.y) + 0.5 - frame.centre.y, lens);
            const float cap = (recordFlags(r) & kFlagScattered) != 0u ? lensDepth(lens, c.z) * largestSplat(kFlagScattered, frame.focal, frame.height) : 3.0e38;
            t.depth = stepInfo.hasFiltered != 0u ? keyDepth(key) : shownDepth(WideDisc(c, n, min(node.edge * radiusFraction(recordRadiusCode(r)) * frame.supportScale, cap), 0u), keyDepth(key));
            t.radius = kExactRadius;
            t.thickness = (recordFlags(r) & kFlagLeaf) != 0u ? kLeafThickness * kExactRadius : kExactRadius;
            t.normalPerp = perpFromNormal(dot(n, v) > 0.0 ? -n : n, v);
            t.colour = pointColour(node, r);
            t.surface = surface;
            if (stepInfo.hasFiltered != 0u) {
                const FilteredPixel p = filtered[pixel.y * frame.width + pixel.x];
                t.normalPerp = perpFromNormal(octDecode(p.normal), v);
                t.thickness = (p.cover & kFilteredLeaf) != 0u ? kLeafThickness * kExactRadius : kExactRadius;
                t.colour = vec3(unpackRed(p.colour), unpackGreen(p.colour), unpackBlue(p.colour));
                t.surface = surfaceOfPoint((p.cover & kFilteredMaterial) != 0u ? p.cover >> 16 : kPlainPoint);
            }
            storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
            return;
        }
        t = texelFromSplat(c, n, radius, lens, frame.minimumRadius);
        if ((recordFlags(r) & kFlagLeaf) != 0u) t.thickness = kLeafThickness * t.radius;
        const float scale = frame.focal / lensDepth(lens, c.z);
        t.offset = vec2(c.x * scale + (frame.centre.x - 0.5) - float(pixel.x), c.y * scale + (frame.centre.y - 0.5) - float(pixel.y));
        t.colour = pointColour(node, r);
        t.surface = surface;
        takeLargest(t.radius);
    }
    storeTexel(stepInfo.fine, stepInfo.fineWidth, stepInfo.fineHeight, pixel, t);
}
