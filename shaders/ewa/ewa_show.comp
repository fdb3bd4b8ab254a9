// What each pixel shows of its sums; where other kinds are in front, those.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
#include "../shared/surface.h"
layout(local_size_x = 64) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const FilteredFront front = fronts[at];
    const FilteredSums s = sums[at];
    const uint64_t exact = visibility[at];
    const bool hasFront = front.key != kNoKey;
    const bool hasExact = exact != kNoKey;
    const float weight = float(s.weight) / s.unit;
    const bool perSurfel = frame.perSurfel != 0u;
    const float covered = weight * (perSurfel ? 1.0 : gridWeight(frame.kernelSupport));
    const uint code = uint(min(covered, 1.0) * 255.0 + 0.5);
    FilteredPixel p;
    p.normal = p.colour = p.cover = 0u;
    const bool isThere = hasFront ? !hasExact || keyDepth(front.key) < keyDepth(exact) : !hasExact && code > 0u;
    if (isThere) {
        const uint id = hasFront ? keyPlace(front.key, 0u) : front.first;
        DrawNode node;
        const PointRecord r = recordOf(id, node);
        float depth = s.reference;
        if (weight > kLeastWeight) {
            const float over = 1.0 / float(s.weight);
            depth = absoluteDepth(float(s.depth) * over, s.reference);
            const float ofColour = perSurfel ? 1.0 / min(float(s.weight), s.unit) : over;
            p.colour = packColour(float(s.red) * ofColour, float(s.green) * ofColour, float(s.blue) * ofColour);
            p.normal = octEncode(vec3(s.nx, s.ny, s.nz) * over);
            if (frame.hasMaterials != 0u) {
                const MaterialSums m = materialSums[at];
                p.cover = coverOfMaterial(TexelSurface(float(m.share) * over, float(m.metallic) * over, float(m.roughness) * over));
            }
        } else {
            const vec3 c = pointColour(node, r);
            p.colour = packColour(c.x, c.y, c.z);
            p.normal = octEncode(towardsEye(opaqueDisc(node, r, id)));
            if (frame.hasMaterials != 0u) p.cover = coverOfMaterial(surfaceOf(id, node));
        }
        const bool isBefore = hasFront && (s.behind != 0u || hasExact);
        p.cover |= (isBefore ? 255u : code) | (hasFront ? kFilteredFront : 0u) | ((recordFlags(r) & kFlagLeaf) != 0u ? kFilteredLeaf : 0u);
        visibility[at] = visibilityKey(floatBitsToUint(depth), drawId(0u, id));
    }
    filtered[at] = p;
}
