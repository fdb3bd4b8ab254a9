// Points as discs that are drawn exactly (mode splat; Botsch & Kobbelt 2003, 3.1 and 3.2, with Eq 2 for a pinhole
// camera): every pixel whose ray meets a disc is its own, at the depth where it does. Of a disc so small that it
// could lie between the centres of pixels, the pixel that holds its centre is one of them though its ray misses: no
// disc is too small to be seen. So it is of any disc that stands alone. (Of others it misses those that are seen at a
// slant; with such a pixel outlines would be half a pixel too far out. What they stand on is covered by their
// neighbours.) Such a pixel competes at the depth of the disc's plane on its ray (ownDepth), so that on a surface it
// comes before none whose disc is met, and shows no place beyond the disc (shownDepth).
#ifndef STIPPLE_SHARED_SPLAT_DISC_H
#define STIPPLE_SHARED_SPLAT_DISC_H
#include "splat_size.h"
#include "wide_disc.h"
SHARED_BEGIN

// `scattered`: largestSplat of what no surface joins to others.
SHARED_FN WideDisc splatDisc(DrawNode node, PointRecord r, float supportScale, float scattered, uint id, Lens lens) {
    WideDisc d = wideDisc(node, r, supportScale, id, lens);
    const float cap =
        (recordFlags(r) & kFlagScattered) != 0u ? max(lensDepth(lens, d.centre.z), 0.0f) * scattered : 3.0e38f;
    d.radius = min(d.radius, cap);
    d.id = id;
    return d;
}

// 1 if a point's disc is to be drawn: it is fine enough for its node, and faces the eye.
SHARED_FN float isSplatSeen(DrawNode node, PointRecord r, WideDisc d, float nearPlane, Lens lens) {
    // Products, not conditions: compilers make SIMD of these.
    const float drawnHere = float(int(node.octantMask >> recordOctant(r) & 1u));
    const float fine = max(drawnHere, recordErrorCode(r) <= node.errorCode ? 1.0f : 0.0f);
    const float front = dot(d.normal, sightTo(lens, d.centre)) < 0.0f ? 1.0f : 0.0f;
    const float seen = (recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) != 0u ? 1.0f : front;
    // Of no normal, it faces the eye from where it is: behind the eye there is no such side.
    const float isAhead = d.centre.z > nearPlane ? 1.0f : 0.0f;
    const float faces = (recordFlags(r) & kFlagNoNormal) != 0u ? isAhead : 1.0f;
    return fine * seen * faces;
}

// The pixel that holds the centre; x is -1 where there is none.
struct CentrePixel {
    int x;
    int y;
};
SHARED_FN CentrePixel centrePixel(WideDisc d, FrameConstants f) {
    const bool isAhead = d.centre.z > f.nearPlane;
    const float scale = f.focal / (isAhead ? lensDepth(frameLens(f), d.centre.z) : 1.0f);
    const float x = d.centre.x * scale + f.centre.x;
    const float y = d.centre.y * scale + f.centre.y;
    const float right = float(int(f.width)) - 0.5f;
    const float bottom = float(int(f.height)) - 0.5f;
    // Beside the picture, or behind the eye: less than 0.
    const float within = min(min(x, right - floor(x)), min(y, bottom - floor(y)));
    const bool isInside = (isAhead ? within : -1.0f) >= 0.0f;
    CentrePixel p;
    p.x = isInside ? int(x) : -1;
    p.y = isInside ? int(y) : -1;
    return p;
}

// Radius up to which a disc that faces the eye may lie between the centres of pixels, px.
const float kBetweenPixels = 0.70710678f;
// A disc stands alone if its diameter is less than the spacing. (Both are codes, often just the same: a thousandth,
// which is less than a step between codes, keeps rounding from telling them apart.)
const float kAloneDiameters = 2.002f;
// Does no neighbour cover what a disc stands on? `radius`: as stored; `spacing`: of its node, 0: not known.
SHARED_FN bool isAlone(uint flags, float radius, float spacing) {
    return (flags & (kFlagScattered | kFlagLeaf)) != 0u || !(kAloneDiameters * radius >= spacing);
}
const uint kAlone = 0x80000000u;  // where it is said with the id of a disc; ids of the visibility buffer have it not
// The pixel that holds the centre, of discs that stand alone or are no larger than that only.
SHARED_FN CentrePixel ownPixel(WideDisc d, bool isAloneHere, FrameConstants f) {
    CentrePixel p = centrePixel(d, f);
    p.x = isAloneHere || d.radius * f.focal < kBetweenPixels * lensDepth(frameLens(f), d.centre.z) ? p.x : -1;
    return p;
}

// Where a disc ends, nearest and farthest, by its slope. (Not of 1 - n.z^2, of which nothing is left of planes that
// face the eye.)
SHARED_FN float discReach(WideDisc d) {
    return 1.0001f * d.radius * sqrt(d.normal.x * d.normal.x + d.normal.y * d.normal.y);
}
// So far behind a disc, px, its plane is followed at the most: right for planes that are seen at more than half a
// degree.
const float kPlanePixels = 64.0f;
// The depth by which a disc competes for the pixel of its centre if that pixel's ray misses it: that of its plane
// there, no nearer than the disc is (what is met of its neighbours lies there), and by a quarter of its radius behind
// those of the same plane.
SHARED_FN float ownDepth(WideDisc d, PixelRay ray, FrameConstants f) {
    const Lens lens = frameLens(f);
    const float reach = discReach(d);
    const float beyond = kPlanePixels * lensDepth(lens, d.centre.z) / f.focal;
    const float nearest = max(d.centre.z - reach, f.nearPlane);
    const float farthest = max(d.centre.z + reach + beyond, nearest);
    const vec3 c = fromRay(ray, d.centre);
    const float facing = d.normal.x * ray.ex + d.normal.y * ray.ey + d.normal.z;
    const float ahead = d.normal.x * c.x + d.normal.y * c.y + d.normal.z * c.z;
    // Parallel rays meet any plane at ahead / facing; those of an eye meet it at no depth, where facing / ahead is not
    // above 0: beyond its horizon.
    const float along = ahead / (abs(facing) > 1.0e-30f ? facing : 1.0e-30f);
    const float linear = facing / (abs(ahead) > 1.0e-30f ? ahead : 1.0e-30f);
    const float plane = lens.isOrthographic ? along : 1.0f / max(linear, 1.0e-30f);
    return min(max(plane, nearest), farthest) + kThicknessRadii * d.radius;
}
// Of what competed at `depth`, the place that is shown.
SHARED_FN float shownDepth(WideDisc d, float depth) { return min(depth, d.centre.z + discReach(d)); }

SHARED_END
#endif
