// What each pixel shows of its sums; where other kinds are in front, those.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../filtered.glsl"
#include "../shared/surface.h"
layout(local_size_x = kPixelTile, local_size_y = kPixelTile) in;

void main() {
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    const uint at = pixel.y * frame.width + pixel.x;
    const FilteredFront front = fronts[at];
    const FilteredSums s = sums[at];
    const uint64_t exact = visibility[at];
    const bool hasFront = front.key != kNoKey;
    const bool hasExact = exact != kNoKey;
    const bool isBlended = float(s.weight) / s.unit > kLeastWeight;
    const uint code = uint(min(coveredBy(s.weight + s.rims, s.unit), 1.0) * 255.0 + 0.5);
    FilteredPixel p;
    p.normal = p.colour = p.cover = 0u;
    const bool isThere = hasFront ? !hasExact || keyDepth(front.key) < keyDepth(exact) : !hasExact && code > 0u;
    bool isLeaf = false;
    if (isThere) {
        const uint id = hasFront ? keyPlace(front.key, 0u) : front.first;
        DrawNode node;
        const PointRecord r = recordOf(id, node);
        isLeaf = (recordFlags(r) & kFlagLeaf) != 0u;
        float depth = s.reference;
        if (isBlended)
            depth = shownOf(at, s, p);
        else
            p = ownOf(id, node, r);
        depth = hasFront ? withinFront(opaqueDisc(node, r, id), pixel, depth)
                         : max(placeOfMissed(opaqueDisc(node, r, id), depth), frame.nearPlane);
        const bool isBefore = hasFront && (s.behind != 0u || hasExact);
        p.cover |= (isBefore ? 255u : code) | (hasFront ? kFilteredFront : 0u) | (isLeaf ? kFilteredLeaf : 0u);
        visibility[at] = visibilityKey(floatBitsToUint(depth), drawId(0u, id));
    }
    filtered[at] = p;
    // Which second surface there may be.
    const bool isShown = hasFront && isThere;
    const float before = isShown ? coveredBy(s.rims, s.unit) : hasExact ? coveredBy(s.rims + s.weight, s.unit) : 0.0;
    const float covered = coveredBy(s.weight, s.unit);
    const bool ends = isShown && (s.behind != 0u || hasExact) && 1.0 - covered >= max(kLeastShare, before);
    const uint kind = ends ? (isLeaf ? kSecondNone : kSecondBehind) : before >= kLeastShare ? kSecondBefore : kSecondNone;
    coverage[at] = kind << kSecondShift;
    if (kind == kSecondNone) return;
    if (kind == kSecondBehind) {
        sums[at].rims = s.weight;
        sums[at].nearest = keyDepth(front.key);
        fronts[at].key = exact;
    } else if (!isShown) {
        fronts[at].key = kNoKey;  // its rims are those before the other kind
    }
}
