// Second surfaces of pixels, and how much of them they are.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const uint kind = secondKind(at);
    if (kind == kSecondNone) return;
    FilteredPixel p;
    const FilteredSums s = sums[at];
    float depth;
    float share = coveredBy(s.rims, s.unit);
    if (kind == kSecondFront) {
        p = filtered[at];
        depth = keyDepth(visibility[at]);
        visibility[at] = fronts[at].key;
    } else {
        const float covered = min(coveredBy(s.weight, s.unit), 1.0);
        if (kind == kSecondBefore && covered < kLeastShare) {
            coverage[at] &= 255u;
            return;
        }
        DrawNode node;
        const uint id = kind == kSecondBefore ? fronts[at].first : keyPlace(fronts[at].key, 0u);
        const PointRecord r = recordOf(id, node);
        depth = s.reference;
        if (float(s.weight) / s.unit > kLeastWeight)
            depth = shownOf(at, s, p);
        else
            p = ownOf(id, node, r);
        p.cover |= (recordFlags(r) & kFlagLeaf) != 0u ? kFilteredLeaf : 0u;
        share = kind == kSecondBefore ? covered : 1.0 - min(share, 1.0);
    }
    uint material = kPlainSurface;
    if (frame.hasMaterials != 0u && (p.cover & kFilteredMaterial) != 0u) material = surfaceWord(surfaceOfPoint(p.cover >> 16));
    if ((p.cover & kFilteredLeaf) != 0u) material |= kPixelLeaf;
    sums[at] = sumsOfSecond(SecondSurface(SurfaceWords(depth, p.normal, p.colour, material), min(share, 1.0)));
}
