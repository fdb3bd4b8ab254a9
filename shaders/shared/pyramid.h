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
SHARED_FN vec3 besideFirst(Texel t, vec3 first, float isRound, float weight) {
    const vec3 n = texelNormal(t);
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

// Of the first of four texels that counts.
SHARED_FN vec3 firstNormal(Texel t0, Texel t1, Texel t2, Texel t3, float w0, float w1, float w2) {
    Texel first = t3;
    first.normalPerp = vec2(w0 > 0.0f   ? t0.normalPerp.x
                            : w1 > 0.0f ? t1.normalPerp.x
                            : w2 > 0.0f ? t2.normalPerp.x
                                        : t3.normalPerp.x,
                            w0 > 0.0f   ? t0.normalPerp.y
                            : w1 > 0.0f ? t1.normalPerp.y
                            : w2 > 0.0f ? t2.normalPerp.y
                                        : t3.normalPerp.y);
    return texelNormal(first);
}

SHARED_FN Texel texelFromBlend(Blend b, float isRound, Lens lens) {
    Texel t;
    const float s = b.weight > 0.0f ? 1.0f / b.weight : 0.0f;
    const float depth = lens.isOrthographic ? b.inverseDepth * s : b.weight / max(b.inverseDepth, 1.0e-37f);
    t.depth = b.weight > 0.0f ? depth : 0.0f;
    t.radius = b.radius * s;
    t.thickness = b.thickness * s;
    t.offset = vec2(b.x * s, b.y * s);
    const vec3 n = b.normal;
    const float unit = 1.0f / sqrt(max(n.x * n.x + n.y * n.y + n.z * n.z, 1.0e-30f));
    const float toEye = n.z > 0.0f ? -unit : unit;
    const float across = isRound > 0.5f ? s : toEye;
    t.normalPerp = vec2(n.x * across, n.y * across);
    t.colour = vec3(b.red * s, b.green * s, b.blue * s);
    t.isRound = isRound;
    t.axis = vec2(b.axisX * s, b.axisY * s);
    t.surface.share = b.surface.share * s;
    t.surface.metallic = b.surface.metallic * s;
    t.surface.roughness = b.surface.roughness * s;
    return t;
}

// 1 for what may be merged: tubes with tubes, all else with all else, as the one says whose interval ends first.
SHARED_FN float isLike(Texel t, float isRound) { return abs(t.isRound - isRound) < 0.5f ? 1.0f : 0.0f; }

const float kFarAway = 3.0e38f;
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
    const float w0 = d0 < kFarAway && d0 - t0 <= back ? isLike(c0, isRound) : 0.0f;
    const float w1 = d1 < kFarAway && d1 - t1 <= back ? isLike(c1, isRound) : 0.0f;
    const float w2 = d2 < kFarAway && d2 - t2 <= back ? isLike(c2, isRound) : 0.0f;
    const float w3 = d3 < kFarAway && d3 - t3 <= back ? isLike(c3, isRound) : 0.0f;
    const float a0 = w0 * (c0.radius * c0.radius);
    const float a1 = w1 * (c1.radius * c1.radius);
    const float a2 = w2 * (c2.radius * c2.radius);
    const float a3 = w3 * (c3.radius * c3.radius);
    const vec3 first = firstNormal(c0, c1, c2, c3, w0, w1, w2);
    Blend b = emptyBlend();
    b = addToBlend(b, c0, imageLinear(lens, max(c0.depth, kLeastDepth)), x0, y0, besideFirst(c0, first, isRound, a0),
                   a0);
    b = addToBlend(b, c1, imageLinear(lens, max(c1.depth, kLeastDepth)), x1, y1, besideFirst(c1, first, isRound, a1),
                   a1);
    b = addToBlend(b, c2, imageLinear(lens, max(c2.depth, kLeastDepth)), x2, y2, besideFirst(c2, first, isRound, a2),
                   a2);
    b = addToBlend(b, c3, imageLinear(lens, max(c3.depth, kLeastDepth)), x3, y3, besideFirst(c3, first, isRound, a3),
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

// What the push needs of a coarse texel beside itself.
struct CoarseDisc {
    vec2 slope;          // ellipseSlope
    float inverseDepth;  // imageLinear
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
const float kSurrounding = 4.0f;  // coarse texels of one surface that make a fine texel lie inside it

// How much whatever is nearest of four coarse texels counts for a fine one that none of them reaches (`missed`): an
// empty texel between four filled ones is not left open, within reason (large discs that only share a coarse texel are
// not one surface). What lies outside the image (depth < 0) may be filled or not and does not keep a gap open. Between
// leaves it stays open. So does what lies behind all four (`hindmost`): a point of the far side that shines through
// between the near ones.
SHARED_FN float gapBetween(float fineDepth, Texel q0, Texel q1, Texel q2, Texel q3, float missed, float least,
                           float hindmost, float fineSize) {
    const float leaves = max(max(q0.depth > 0.0f ? isLeaf(q0.thickness, q0.radius) : 0.0f,
                                 q1.depth > 0.0f ? isLeaf(q1.thickness, q1.radius) : 0.0f),
                             max(q2.depth > 0.0f ? isLeaf(q2.thickness, q2.radius) : 0.0f,
                                 q3.depth > 0.0f ? isLeaf(q3.thickness, q3.radius) : 0.0f));
    const float isSolid = 1.0f - leaves;
    const float noneEmpty =
        min(min(abs(q0.depth), abs(q1.depth)), min(abs(q2.depth), abs(q3.depth))) > 0.0f ? missed * isSolid : 0.0f;
    const float isBorder = min(min(q0.depth, q1.depth), min(q2.depth, q3.depth)) < 0.0f ? 1.0f : 0.0f;
    const float isLarge = fineSize > kBorderTexel ? 1.0f : 0.0f;
    const float farthest = isBorder * isLarge > 0.5f ? kBorderReach2 : kGapReach2;
    const float oneFilled = least < farthest ? noneEmpty : 0.0f;
    const float shines = fineDepth > hindmost ? missed * isSolid : 0.0f;
    return fineDepth <= 0.0f ? oneFilled : shines;
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

// Refines one fine texel from the four coarse texels around it. q0 is its parent, q1 the neighbour in x, q2 in y, q3 in
// both; (sx, sy) = -1 or +1 say on which side of the parent's centre the fine texel lies. `fineSize`: its edge, pixels.
// The fine texel is replaced iff it is empty or lies behind what the coarse ones say is in front of it (F13). Where no
// coarse ellipse reaches it, it stays as it is, unless three of the coarse texels are filled and of one surface: then
// the texel lies inside that surface, and a gap there is only the averaging of the pull (a merged splat stands at the
// middle of its parts), so the ellipses count with twice their radius.
// `e0` to `e3`: coarseDisc of q0 to q3; (x, y): centre of the fine texel, px from the principal point.
SHARED_FN Texel pushTexel(Texel own, Texel q0, Texel q1, Texel q2, Texel q3, CoarseDisc e0, CoarseDisc e1,
                          CoarseDisc e2, CoarseDisc e3, float sx, float sy, float x, float y, float fineSize,
                          Lens lens) {
    const float inverseFocal = 1.0f / lens.focal;
    Texel fine = own;
    fine.depth = fineSize < 1.5f && isBeside(own.offset) > 0.5f ? 0.0f : own.depth;
    const float coarseSize = 2.0f * fineSize;
    // Centre of each coarse texel relative to the fine texel's centre, pixels.
    const float nearX = -0.5f * fineSize * sx;
    const float nearY = -0.5f * fineSize * sy;
    const float farX = nearX + coarseSize * sx;
    const float farY = nearY + coarseSize * sy;
    const float x0 = nearX + q0.offset.x;
    const float y0 = nearY + q0.offset.y;
    const float x1 = farX + q1.offset.x;
    const float y1 = nearY + q1.offset.y;
    const float x2 = nearX + q2.offset.x;
    const float y2 = farY + q2.offset.y;
    const float x3 = farX + q3.offset.x;
    const float y3 = farY + q3.offset.y;
    const float r0 = pushRho2(q0, e0, x, y, x0, y0, lens);
    const float r1 = pushRho2(q1, e1, x, y, x1, y1, lens);
    const float r2 = pushRho2(q2, e2, x, y, x2, y2, lens);
    const float r3 = pushRho2(q3, e3, x, y, x3, y3, lens);
    const float t0 = thicknessWorld(q0, lens, inverseFocal);
    const float t1 = thicknessWorld(q1, lens, inverseFocal);
    const float t2 = thicknessWorld(q2, lens, inverseFocal);
    const float t3 = thicknessWorld(q3, lens, inverseFocal);
    const float least = min(min(r0, r1), min(r2, r3));
    const float missed = least < 1.0f ? 0.0f : 1.0f;
    const float n0 = q0.depth > 0.0f ? q0.depth : kFarAway;
    const float n1 = q1.depth > 0.0f ? q1.depth : kFarAway;
    const float n2 = q2.depth > 0.0f ? q2.depth : kFarAway;
    const float n3 = q3.depth > 0.0f ? q3.depth : kFarAway;
    const float nearBack = min(min(n0 + t0, n1 + t1), min(n2 + t2, n3 + t3));
    const float together = (n0 - t0 <= nearBack ? 1.0f : 0.0f) + (n1 - t1 <= nearBack ? 1.0f : 0.0f) +
                           (n2 - t2 <= nearBack ? 1.0f : 0.0f) + (n3 - t3 <= nearBack ? 1.0f : 0.0f);
    // Conditions as numbers: branches would keep compilers from turning loops over this function into SIMD.
    const float inside = together >= kSurrounding ? 1.0f : 0.0f;
    const float scale = missed * inside > 0.5f ? 0.25f : 1.0f;
    const float hindmost = max(max(n0 + t0, n1 + t1), max(n2 + t2, n3 + t3));
    const float between = gapBetween(fine.depth, q0, q1, q2, q3, missed, least, hindmost, fineSize);
    const float k0 = max(kernelWeight(r0 * scale), between * gapWeight(r0, least));
    const float k1 = max(kernelWeight(r1 * scale), between * gapWeight(r1, least));
    const float k2 = max(kernelWeight(r2 * scale), between * gapWeight(r2, least));
    const float k3 = max(kernelWeight(r3 * scale), between * gapWeight(r3, least));
    const float d0 = k0 > 0.0f ? q0.depth : kFarAway;
    const float d1 = k1 > 0.0f ? q1.depth : kFarAway;
    const float d2 = k2 > 0.0f ? q2.depth : kFarAway;
    const float d3 = k3 > 0.0f ? q3.depth : kFarAway;
    const float back = min(min(d0 + t0, d1 + t1), min(d2 + t2, d3 + t3));
    const float isRound = d0 + t0 <= back   ? q0.isRound
                          : d1 + t1 <= back ? q1.isRound
                          : d2 + t2 <= back ? q2.isRound
                                            : q3.isRound;
    const float w0 = d0 < kFarAway && d0 - t0 <= back ? k0 * isLike(q0, isRound) : 0.0f;
    const float w1 = d1 < kFarAway && d1 - t1 <= back ? k1 * isLike(q1, isRound) : 0.0f;
    const float w2 = d2 < kFarAway && d2 - t2 <= back ? k2 * isLike(q2, isRound) : 0.0f;
    const float w3 = d3 < kFarAway && d3 - t3 <= back ? k3 * isLike(q3, isRound) : 0.0f;
    const vec3 first = firstNormal(q0, q1, q2, q3, w0, w1, w2);
    Blend b = emptyBlend();
    b = addToBlend(b, q0, e0.inverseDepth, x0, y0, besideFirst(q0, first, isRound, w0), w0);
    b = addToBlend(b, q1, e1.inverseDepth, x1, y1, besideFirst(q1, first, isRound, w1), w1);
    b = addToBlend(b, q2, e2.inverseDepth, x2, y2, besideFirst(q2, first, isRound, w2), w2);
    b = addToBlend(b, q3, e3.inverseDepth, x3, y3, besideFirst(q3, first, isRound, w3), w3);
    const float hasBlend = b.weight > 0.0f ? 1.0f : 0.0f;
    const float isBehind = fine.depth > back ? 1.0f : 0.0f;
    const float isEmpty = fine.depth <= 0.0f ? 1.0f : 0.0f;
    // So is one that does not reach its own texel's centre (of splats beside the picture): others may.
    const float off2 = fine.offset.x * fine.offset.x + fine.offset.y * fine.offset.y;
    const float least2 =
        max(fine.radius * fine.radius, fineSize * fineSize);  // (of others the centre lies in the texel)
    const float isMissed = off2 > least2 ? 1.0f : 0.0f;
    const bool replace = hasBlend * (isBehind + isEmpty + isMissed) > 0.5f;
    return chosenTexel(replace, texelFromBlend(b, isRound, lens), fine);
}

SHARED_END
#endif
