// Pull (fine to coarse) and push (coarse to fine): PP-A of ALGORITHMS 1.4, after Marroquim, Kraus, Cavalcanti 2008,
// with that paper's flaws F11 to F16 corrected. Each function works on one texel; the backends only move texels.
//
// The weight of a splat at rho is (1 - rho^2)^2: zero with zero slope at the rim like the shifted exp(-2 rho^2) of the
// papers, but without a transcendental function, so that all backends agree to the last bits.
#ifndef STIPPLE_SHARED_PYRAMID_H
#define STIPPLE_SHARED_PYRAMID_H
#include "splat.h"
#include "splat_size.h"
SHARED_BEGIN

// Running sums of texels that are merged.
struct Blend {
    float weight;
    float inverseDepth;
    float radius;
    float thickness;
    float x;
    float y;
    vec3 normal;  // across the view and along it, all to the side of the first; of tubes the first two are normalPerp
    float red;
    float green;
    float blue;
    float axisX;
    float axisY;
    TexelSurface surface;
};

SHARED_FN Blend emptyBlend() {
    Blend b;
    b.weight = 0.0f;
    b.inverseDepth = 0.0f;
    b.radius = 0.0f;
    b.thickness = 0.0f;
    b.x = 0.0f;
    b.y = 0.0f;
    b.normal = vec3(0.0f, 0.0f, 0.0f);
    b.red = 0.0f;
    b.green = 0.0f;
    b.blue = 0.0f;
    b.axisX = 0.0f;
    b.axisY = 0.0f;
    b.surface = noSurface();
    return b;
}

// Across the view of its centre and along it.
SHARED_FN vec3 texelNormal(Texel t) {
    const vec2 p = t.normalPerp;
    return vec3(p.x, p.y, -sqrt(max(1.0f - p.x * p.x - p.y * p.y, 0.0f)));
}
// Normals are turned to the eye, since nobody knows which way they point. Of discs before an outline and behind it
// these are opposite across the view: their mean would be a disc that faces the eye and stands out of the outline, a
// knob. So they are added up to the side of the first one. (Tubes: as they are.)
SHARED_FN vec3 besideFirst(vec3 n, vec3 first, float isRound, float weight) {
    const float along = n.x * first.x + n.y * first.y + n.z * first.z;
    const float signed_ = along < 0.0f && isRound < 0.5f ? -weight : weight;
    return vec3(signed_ * n.x, signed_ * n.y, signed_ * n.z);
}

// `x`, `y`: centre of the splat relative to the texel being made, pixels. Of texels in one plane, 1 / depth and place
// are averaged to a point of that plane: 1 / depth is linear on the image. (Orthographic: the depth, imageLinear.)
// `normal`: besideFirst, times the weight.
SHARED_FN Blend addToBlend(Blend b, Texel t, float inverseDepth, float x, float y, vec3 normal, float weight) {
    b.weight += weight;
    b.inverseDepth += weight * inverseDepth;
    b.radius += weight * t.radius;
    b.thickness += weight * t.thickness;
    b.x += weight * x;
    b.y += weight * y;
    b.normal = vec3(b.normal.x + normal.x, b.normal.y + normal.y, b.normal.z + normal.z);
    b.red += weight * t.colour.x;
    b.green += weight * t.colour.y;
    b.blue += weight * t.colour.z;
    b.axisX += weight * t.axis.x;
    b.axisY += weight * t.axis.y;
    b.surface.share += weight * t.surface.share;
    b.surface.metallic += weight * t.surface.metallic;
    b.surface.roughness += weight * t.surface.roughness;
    return b;
}

// Of the first of four texels that counts. (One selection after the other: conditions that are joined take longer.)
SHARED_FN vec3 firstNormal(vec3 n0, vec3 n1, vec3 n2, vec3 n3, float w0, float w1, float w2) {
    vec3 first = vec3(w2 > 0.0f ? n2.x : n3.x, w2 > 0.0f ? n2.y : n3.y, w2 > 0.0f ? n2.z : n3.z);
    first = vec3(w1 > 0.0f ? n1.x : first.x, w1 > 0.0f ? n1.y : first.y, w1 > 0.0f ? n1.z : first.z);
    return vec3(w0 > 0.0f ? n0.x : first.x, w0 > 0.0f ? n0.y : first.y, w0 > 0.0f ? n0.z : first.z);
}

// `n`: Blend's normal, of texels whose weights are `weight` together.
SHARED_FN vec2 blendedPerp(vec3 n, float weight, float isRound) {
    const float s = weight > 0.0f ? 1.0f / weight : 0.0f;
    const float unit = 1.0f / sqrt(max(n.x * n.x + n.y * n.y + n.z * n.z, 1.0e-30f));
    const float toEye = n.z > 0.0f ? -unit : unit;
    const float across = isRound > 0.5f ? s : toEye;
    return vec2(n.x * across, n.y * across);
}
SHARED_FN Texel texelFromBlend(Blend b, float isRound, Lens lens) {
    Texel t;
    const float s = b.weight > 0.0f ? 1.0f / b.weight : 0.0f;
    const float depth = lens.isOrthographic ? b.inverseDepth * s : b.weight / max(b.inverseDepth, 1.0e-37f);
    t.depth = b.weight > 0.0f ? depth : 0.0f;
    t.radius = b.radius * s;
    t.thickness = b.thickness * s;
    t.offset = vec2(b.x * s, b.y * s);
    t.normalPerp = blendedPerp(b.normal, b.weight, isRound);
    t.colour = vec3(b.red * s, b.green * s, b.blue * s);
    t.isRound = isRound;
    t.axis = vec2(b.axisX * s, b.axisY * s);
    t.surface.share = b.surface.share * s;
    t.surface.metallic = b.surface.metallic * s;
    t.surface.roughness = b.surface.roughness * s;
    return t;
}

// 1 for what may be merged: tubes with tubes, all else with all else, as the one says whose interval ends first.
SHARED_FN float isLike(float one, float isRound) { return abs(one - isRound) < 0.5f ? 1.0f : 0.0f; }

const float kFarAway = 3.0e38f;
const float kNowhere = 3.3e38f;  // behind what is far away
const float kLeastDepth = 1.0e-30f;

// Depth of a child that reaches beyond its own texel, else kFarAway. The papers ask for more, that the ellipse contain
// the parent's centre; with splats of about the spacing of the pixels that test drops one in three and tears holes.
SHARED_FN float depthIfWide(Texel t, float childSize) {
    const bool wide = t.depth > 0.0f && t.radius >= 0.5f * childSize;
    return wide ? t.depth : kFarAway;
}

// Half-thickness in world units.
SHARED_FN float thicknessWorld(Texel t, Lens lens, float inverseFocal) {
    return t.thickness * lensDepth(lens, t.depth) * inverseFocal;
}

// Merges the four children (order: (0,0) (1,0) (0,1) (1,1)) into their parent. `childSize`: edge of a child texel in
// pixels. Kept are the children that reach beyond their own texel and whose depth interval [depth - t, depth + t] meets
// all the others': it begins before the first of them ends. (Not "meets the front one's": copies of one splat have the
// same depth to the last bit or not, and which of them is in front must not matter.) Where the interval of the result
// ends is counted from the front one and capped, so that layers do not chain (F12, case 42). They count by their areas:
// of wide and narrow splats side by side the wide ones close the gaps.
SHARED_FN Texel pullTexels(Texel c0, Texel c1, Texel c2, Texel c3, float childSize, Lens lens) {
    const float inverseFocal = 1.0f / lens.focal;
    const float h = 0.5f * childSize;
    const float x0 = c0.offset.x - h;
    const float y0 = c0.offset.y - h;
    const float x1 = c1.offset.x + h;
    const float y1 = c1.offset.y - h;
    const float x2 = c2.offset.x - h;
    const float y2 = c2.offset.y + h;
    const float x3 = c3.offset.x + h;
    const float y3 = c3.offset.y + h;
    const float d0 = depthIfWide(c0, childSize);
    const float d1 = depthIfWide(c1, childSize);
    const float d2 = depthIfWide(c2, childSize);
    const float d3 = depthIfWide(c3, childSize);
    const float front = min(min(d0, d1), min(d2, d3));
    const float t0 = thicknessWorld(c0, lens, inverseFocal);
    const float t1 = thicknessWorld(c1, lens, inverseFocal);
    const float t2 = thicknessWorld(c2, lens, inverseFocal);
    const float t3 = thicknessWorld(c3, lens, inverseFocal);
    const float back = min(min(d0 + t0, d1 + t1), min(d2 + t2, d3 + t3));
    const float isRound = d0 + t0 <= back   ? c0.isRound
                          : d1 + t1 <= back ? c1.isRound
                          : d2 + t2 <= back ? c2.isRound
                                            : c3.isRound;
    const float w0 = d0 < kFarAway && d0 - t0 <= back ? isLike(c0.isRound, isRound) : 0.0f;
    const float w1 = d1 < kFarAway && d1 - t1 <= back ? isLike(c1.isRound, isRound) : 0.0f;
    const float w2 = d2 < kFarAway && d2 - t2 <= back ? isLike(c2.isRound, isRound) : 0.0f;
    const float w3 = d3 < kFarAway && d3 - t3 <= back ? isLike(c3.isRound, isRound) : 0.0f;
    const float a0 = w0 * (c0.radius * c0.radius);
    const float a1 = w1 * (c1.radius * c1.radius);
    const float a2 = w2 * (c2.radius * c2.radius);
    const float a3 = w3 * (c3.radius * c3.radius);
    const vec3 n0 = texelNormal(c0);
    const vec3 n1 = texelNormal(c1);
    const vec3 n2 = texelNormal(c2);
    const vec3 n3 = texelNormal(c3);
    const vec3 first = firstNormal(n0, n1, n2, n3, w0, w1, w2);
    Blend b = emptyBlend();
    b = addToBlend(b, c0, imageLinear(lens, max(c0.depth, kLeastDepth)), x0, y0, besideFirst(n0, first, isRound, a0),
                   a0);
    b = addToBlend(b, c1, imageLinear(lens, max(c1.depth, kLeastDepth)), x1, y1, besideFirst(n1, first, isRound, a1),
                   a1);
    b = addToBlend(b, c2, imageLinear(lens, max(c2.depth, kLeastDepth)), x2, y2, besideFirst(n2, first, isRound, a2),
                   a2);
    b = addToBlend(b, c3, imageLinear(lens, max(c3.depth, kLeastDepth)), x3, y3, besideFirst(n3, first, isRound, a3),
                   a3);
    Texel t = texelFromBlend(b, isRound, lens);
    const float deepest = max(max(w0 * c0.depth, w1 * c1.depth), max(w2 * c2.depth, w3 * c3.depth));
    const float thickest = max(max(w0 * t0, w1 * t1), max(w2 * t2, w3 * t3));
    // Leaves stay leaves.
    const float thinnest =
        min(min(w0 > 0.0f ? c0.thickness / c0.radius : 1.0f, w1 > 0.0f ? c1.thickness / c1.radius : 1.0f),
            min(w2 > 0.0f ? c2.thickness / c2.radius : 1.0f, w3 > 0.0f ? c3.thickness / c3.radius : 1.0f));
    const float end = min(thickest + deepest, front + (thinnest < kLeafLimit ? 1.0f : 2.0f) * thickest);
    t.thickness =
        b.weight > 0.0f ? max(end - t.depth, 0.5f * thickest) / (lensDepth(lens, t.depth) * inverseFocal) : 0.0f;
    return t;
}

// What the push needs of a coarse texel beside itself: the same for all fine texels around it.
const uint kCoarseEmpty = 1u;
const uint kCoarseOutside = 2u;  // the image
const uint kCoarseLeaf = 4u;
struct CoarseDisc {
    vec2 slope;          // ellipseSlope
    float inverseDepth;  // imageLinear
    float facing;        // texelNormal's part along the view
    float front;         // its interval of depths; of an empty one both are kFarAway
    float end;
    uint kinds;  // kCoarse...
};
// Half the width to which an edge-on splat is drawn, pixels. Half a pixel would show it wherever it is; that sets the
// outlines of round bodies, where all discs are seen edge-on, half a pixel out (and with them points of planes that no
// disc reaches).
const float kEdgeOn = 0.25f;
// `x`, `y`: centre of the texel, px from the principal point. (ellipseSlope keeps half a pixel of the radius it gets.)
SHARED_FN CoarseDisc coarseDisc(Texel t, float x, float y, Lens lens) {
    CoarseDisc d;
    d.slope = ellipseSlope(t.normalPerp, t.isRound, max(t.radius, 1.0e-3f) * (0.5f / kEdgeOn), x + t.offset.x,
                           y + t.offset.y, lens);
    d.inverseDepth = imageLinear(lens, max(t.depth, kLeastDepth));
    d.facing = texelNormal(t).z;
    const float reach = thicknessWorld(t, lens, 1.0f / lens.focal);
    d.front = t.depth > 0.0f ? t.depth - reach : kFarAway;
    d.end = t.depth > 0.0f ? t.depth + reach : kFarAway;
    const uint leaf = isLeaf(t.thickness, t.radius) > 0.5f ? kCoarseLeaf : 0u;
    const uint none = t.depth < 0.0f ? kCoarseOutside : kCoarseEmpty;
    d.kinds = t.depth > 0.0f ? leaf : none;
    return d;
}

// rho^2 of a coarse texel at the fine one's centre (x, y) px from the principal point; (dx, dy) leads from there to the
// splat's centre. kFarAway where it is empty.
SHARED_FN float pushRho2(Texel t, CoarseDisc d, float x, float y, float dx, float dy, Lens lens) {
    const float rho2 = discRho2(d.slope, max(t.radius, 1.0e-3f), x + dx, y + dy, lens, -dx, -dy);
    return t.depth > 0.0f ? rho2 : kFarAway;
}
SHARED_FN float kernelWeight(float rho2) {
    const float k = max(1.0f - rho2, 0.0f);
    return k * k;
}

// Weight of the nearest of four filled texels, where none reaches the fine one between them.
SHARED_FN float gapWeight(float rho2, float least) { return rho2 <= least ? 0.01f : 0.0f; }

// rho^2 up to which an empty texel between four filled coarse ones is closed. At the border of the image fewer than
// four are inside: there, only texels of at most kBorderTexel pixels are closed, as gaps between small splats are.
//
// Measured (tests/golden/gap_test.cpp, three distances each, 172,800 pixels), pixels of the sheet left open / pixels
// drawn that no disc covers:
//   kGapReach2            0          4         9         16         25         64
//   flat, 70 degrees   3,664/7    461/14     90/14      22/14       2/14       2/14
//   noisy, 70 degrees  5,217/85   680/102   142/105      9/105      2/105      2/105
//   irregular, 70      3,534/16   420/22     31/22       2/22       2/22       2/22
//   folds, 0             666/5     11/35      4/145      1/274      0/300      0/446
//   grass, 0               -/3,086  -/3,820   -/5,575    -/8,055    -/10,144   -/13,009
// 25 closes what any closes (the last 2 are the sheets' own corners); what is larger only fills what is open.
const float kGapReach2 = 25.0f;
const float kBorderReach2 = 4.0f;
const float kBorderTexel = 8.0f;

// Four coarse texels side by side, as seen by the four fine ones between them.
struct PushCell {
    float isInside;  // 1: they are of one surface
    float reach2;    // rho^2 up to which they close an empty texel that none of them reaches; -1: not at all
    float hindmost;  // what lies behind this, and none of them reaches, they cover
};
// An empty texel between four filled ones is not left open, within reason (large discs that only share a coarse texel
// are not one surface). What lies outside the image may be filled or not and does not keep a gap open. Between leaves
// it stays open. So does what lies behind all four: a point of the far side that shines through between the near ones.
SHARED_FN PushCell pushCell(CoarseDisc e0, CoarseDisc e1, CoarseDisc e2, CoarseDisc e3, float fineSize) {
    const float nearEnd = min(min(e0.end, e1.end), min(e2.end, e3.end));
    const float hindmost = max(max(e0.end, e1.end), max(e2.end, e3.end));
    const float lastFront = max(max(e0.front, e1.front), max(e2.front, e3.front));
    const uint kinds = e0.kinds | e1.kinds | e2.kinds | e3.kinds;
    const float farthest = (kinds & kCoarseOutside) != 0u && fineSize > kBorderTexel ? kBorderReach2 : kGapReach2;
    PushCell c;
    c.isInside = lastFront <= nearEnd ? 1.0f : 0.0f;
    c.reach2 = (kinds & (kCoarseEmpty | kCoarseLeaf)) != 0u ? -1.0f : farthest;
    c.hindmost = (kinds & kCoarseLeaf) != 0u ? kNowhere : hindmost;
    return c;
}
// 1 where whatever is nearest of the four counts for a fine texel that none of them reaches (`missed`).
SHARED_FN float gapBetween(float fineDepth, PushCell cell, float missed, float least) {
    const float gap = least < cell.reach2 ? missed : 0.0f;
    const float shines = fineDepth > cell.hindmost ? missed : 0.0f;
    return fineDepth <= 0.0f ? gap : shines;
}

SHARED_FN Texel chosenTexel(bool first, Texel a, Texel b) {
    Texel t;
    t.depth = first ? a.depth : b.depth;
    t.radius = first ? a.radius : b.radius;
    t.thickness = first ? a.thickness : b.thickness;
    t.offset = vec2(first ? a.offset.x : b.offset.x, first ? a.offset.y : b.offset.y);
    t.normalPerp = vec2(first ? a.normalPerp.x : b.normalPerp.x, first ? a.normalPerp.y : b.normalPerp.y);
    t.colour = vec3(first ? a.colour.x : b.colour.x, first ? a.colour.y : b.colour.y, first ? a.colour.z : b.colour.z);
    t.isRound = first ? a.isRound : b.isRound;
    t.axis = vec2(first ? a.axis.x : b.axis.x, first ? a.axis.y : b.axis.y);
    t.surface.share = first ? a.surface.share : b.surface.share;
    t.surface.metallic = first ? a.surface.metallic : b.surface.metallic;
    t.surface.roughness = first ? a.surface.roughness : b.surface.roughness;
    return t;
}

// Of the four coarse texels around a fine one, q0 to q3: its parent, the parent's neighbour in x, that in y, that in
// both.
struct OfFour {
    float of0;
    float of1;
    float of2;
    float of3;
};
SHARED_FN OfFour ofFour(float of0, float of1, float of2, float of3) {
    OfFour f;
    f.of0 = of0;
    f.of1 = of1;
    f.of2 = of2;
    f.of3 = of3;
    return f;
}

// Centres of the four splats relative to the fine texel's centre, pixels. (sx, sy) = -1 or +1 say on which side of its
// parent's centre the fine texel lies. `fineSize`: its edge, pixels.
SHARED_FN OfFour pushX(Texel q0, Texel q1, Texel q2, Texel q3, float sx, float fineSize) {
    const float nearX = -0.5f * fineSize * sx;
    const float farX = nearX + 2.0f * fineSize * sx;
    return ofFour(nearX + q0.offset.x, farX + q1.offset.x, nearX + q2.offset.x, farX + q3.offset.x);
}
SHARED_FN OfFour pushY(Texel q0, Texel q1, Texel q2, Texel q3, float sy, float fineSize) {
    const float nearY = -0.5f * fineSize * sy;
    const float farY = nearY + 2.0f * fineSize * sy;
    return ofFour(nearY + q0.offset.y, nearY + q1.offset.y, farY + q2.offset.y, farY + q3.offset.y);
}

// A fine texel, as far as it decides whether it is replaced.
struct PushedTo {
    float depth;     // 0: nothing is there, or a splat beside the picture
    float isMissed;  // 1: it does not reach its own texel's centre (of others that lies in the texel)
};
SHARED_FN PushedTo pushedTo(Texel own, float fineSize) {
    const float off2 = own.offset.x * own.offset.x + own.offset.y * own.offset.y;
    const float least2 = max(own.radius * own.radius, fineSize * fineSize);
    PushedTo to;
    to.depth = fineSize < 1.5f && isBeside(own.offset) > 0.5f ? 0.0f : own.depth;
    to.isMissed = off2 > least2 ? 1.0f : 0.0f;
    return to;
}

// How much each of the four counts for a fine texel.
struct PushShares {
    OfFour of;         // their weights; 0: not of what is in front
    float isRound;     // of those that count
    float isReplaced;  // 1: the fine texel is
};
// The fine texel is replaced iff it is empty or lies behind what the coarse ones say is in front of it (F13). Where no
// coarse ellipse reaches it, it stays as it is, unless all four coarse texels are filled and of one surface: then
// the texel lies inside that surface, and a gap there is only the averaging of the pull (a merged splat stands at the
// middle of its parts), so the ellipses count with twice their radius. `rho2`: pushRho2 of the four.
SHARED_FN PushShares pushShares(PushedTo fine, OfFour front, OfFour end, OfFour isRound, OfFour rho2, PushCell cell) {
    const float least = min(min(rho2.of0, rho2.of1), min(rho2.of2, rho2.of3));
    // Conditions as numbers: branches would keep compilers from turning loops over this function into SIMD.
    const float missed = least < 1.0f ? 0.0f : 1.0f;
    const float scale = missed * cell.isInside > 0.5f ? 0.25f : 1.0f;
    const float between = gapBetween(fine.depth, cell, missed, least);
    const float k0 = max(kernelWeight(rho2.of0 * scale), between * gapWeight(rho2.of0, least));
    const float k1 = max(kernelWeight(rho2.of1 * scale), between * gapWeight(rho2.of1, least));
    const float k2 = max(kernelWeight(rho2.of2 * scale), between * gapWeight(rho2.of2, least));
    const float k3 = max(kernelWeight(rho2.of3 * scale), between * gapWeight(rho2.of3, least));
    const float b0 = k0 > 0.0f ? end.of0 : kFarAway;
    const float b1 = k1 > 0.0f ? end.of1 : kFarAway;
    const float b2 = k2 > 0.0f ? end.of2 : kFarAway;
    const float b3 = k3 > 0.0f ? end.of3 : kFarAway;
    const float back = min(min(b0, b1), min(b2, b3));
    PushShares s;
    s.isRound = b0 <= back ? isRound.of0 : b1 <= back ? isRound.of1 : b2 <= back ? isRound.of2 : isRound.of3;
    const float w0 = front.of0 <= back ? k0 * isLike(isRound.of0, s.isRound) : 0.0f;
    const float w1 = front.of1 <= back ? k1 * isLike(isRound.of1, s.isRound) : 0.0f;
    const float w2 = front.of2 <= back ? k2 * isLike(isRound.of2, s.isRound) : 0.0f;
    const float w3 = front.of3 <= back ? k3 * isLike(isRound.of3, s.isRound) : 0.0f;
    s.of = ofFour(w0, w1, w2, w3);
    const float hasBlend = w0 + w1 + w2 + w3 > 0.0f ? 1.0f : 0.0f;
    const float isBehind = fine.depth > back ? 1.0f : 0.0f;
    const float isEmpty = fine.depth <= 0.0f ? 1.0f : 0.0f;
    // (What is missed by its own splat others may reach.)
    s.isReplaced = hasBlend * (isBehind + isEmpty + fine.isMissed) > 0.5f ? 1.0f : 0.0f;
    return s;
}

// Sum of the normals of the four (besideFirst).
SHARED_FN vec3 pushNormal(vec3 n0, vec3 n1, vec3 n2, vec3 n3, PushShares s) {
    const vec3 first = firstNormal(n0, n1, n2, n3, s.of.of0, s.of.of1, s.of.of2);
    const vec3 b0 = besideFirst(n0, first, s.isRound, s.of.of0);
    const vec3 b1 = besideFirst(n1, first, s.isRound, s.of.of1);
    const vec3 b2 = besideFirst(n2, first, s.isRound, s.of.of2);
    const vec3 b3 = besideFirst(n3, first, s.isRound, s.of.of3);
    return vec3(b0.x + b1.x + b2.x + b3.x, b0.y + b1.y + b2.y + b3.y, b0.z + b1.z + b2.z + b3.z);
}
SHARED_FN vec3 normalOfCoarse(Texel t, CoarseDisc d) { return vec3(t.normalPerp.x, t.normalPerp.y, d.facing); }
// All else of them. `x`, `y`: pushX, pushY; `normal`: pushNormal.
SHARED_FN Texel pushBlend(Texel q0, Texel q1, Texel q2, Texel q3, OfFour inverseDepth, OfFour x, OfFour y, vec3 normal,
                          PushShares s, Lens lens) {
    const vec3 none = vec3(0.0f, 0.0f, 0.0f);
    Blend b = emptyBlend();
    b = addToBlend(b, q0, inverseDepth.of0, x.of0, y.of0, none, s.of.of0);
    b = addToBlend(b, q1, inverseDepth.of1, x.of1, y.of1, none, s.of.of1);
    b = addToBlend(b, q2, inverseDepth.of2, x.of2, y.of2, none, s.of.of2);
    b = addToBlend(b, q3, inverseDepth.of3, x.of3, y.of3, none, s.of.of3);
    b.normal = normal;
    return texelFromBlend(b, s.isRound, lens);
}

// Refines one fine texel from the four coarse texels around it.
// `e0` to `e3`: coarseDisc of q0 to q3; (x, y): centre of the fine texel, px from the principal point.
SHARED_FN Texel pushTexel(Texel own, Texel q0, Texel q1, Texel q2, Texel q3, CoarseDisc e0, CoarseDisc e1,
                          CoarseDisc e2, CoarseDisc e3, float sx, float sy, float x, float y, float fineSize,
                          Lens lens) {
    const OfFour atX = pushX(q0, q1, q2, q3, sx, fineSize);
    const OfFour atY = pushY(q0, q1, q2, q3, sy, fineSize);
    const OfFour rho2 =
        ofFour(pushRho2(q0, e0, x, y, atX.of0, atY.of0, lens), pushRho2(q1, e1, x, y, atX.of1, atY.of1, lens),
               pushRho2(q2, e2, x, y, atX.of2, atY.of2, lens), pushRho2(q3, e3, x, y, atX.of3, atY.of3, lens));
    const PushedTo to = pushedTo(own, fineSize);
    const PushShares shares =
        pushShares(to, ofFour(e0.front, e1.front, e2.front, e3.front), ofFour(e0.end, e1.end, e2.end, e3.end),
                   ofFour(q0.isRound, q1.isRound, q2.isRound, q3.isRound), rho2, pushCell(e0, e1, e2, e3, fineSize));
    const vec3 normal = pushNormal(normalOfCoarse(q0, e0), normalOfCoarse(q1, e1), normalOfCoarse(q2, e2),
                                   normalOfCoarse(q3, e3), shares);
    Texel fine = own;
    fine.depth = to.depth;
    return chosenTexel(
        shares.isReplaced > 0.5f,
        pushBlend(q0, q1, q2, q3, ofFour(e0.inverseDepth, e1.inverseDepth, e2.inverseDepth, e3.inverseDepth), atX, atY,
                  normal, shares, lens),
        fine);
}

SHARED_END
#endif
