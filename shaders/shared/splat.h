// From a record in camera space to a texel of the pyramid, and the ellipse test (ALGORITHMS 1.4, common projection).
//
// A texel carries the splat's centre (offset from its texel's centre), linear depth, screen radius, half-thickness and
// the normal as its two components perpendicular to the view direction v of its centre (the rotation that takes v to z
// by the shortest way). On the image, 1 / depth of the disc's plane is linear: 1/Z = (1 + s.d) / cz with the slope s of
// the plane (1/px) and d pixels from the projected centre C = (Cx, Cy, focal). The hit is e = (cz / focal)
// (d - (s.d) C) / (1 + s.d) from the centre, exactly, in perspective (ALGORITHMS 1.1): rho^2 = |e|^2 / r^2.
#ifndef STIPPLE_SHARED_SPLAT_H
#define STIPPLE_SHARED_SPLAT_H
#include "lens.h"
SHARED_BEGIN

// What lights a texel beside its normal and colour. All 0 where it has no material: then it is lit by one formula.
struct TexelSurface {
    float share;     // of what was merged that has a material
    float metallic;  // times share, as roughness is
    float roughness;
};
SHARED_FN TexelSurface noSurface() {
    TexelSurface s;
    s.share = 0.0f;
    s.metallic = 0.0f;
    s.roughness = 0.0f;
    return s;
}
// `material`: of a point (material.h).
SHARED_FN TexelSurface surfaceOfPoint(uint material) {
    TexelSurface s;
    s.share = material < 0x10000u ? 1.0f : 0.0f;
    s.metallic = s.share * float(int(material & 255u)) * (1.0f / 255.0f);
    s.roughness = s.share * float(int(material >> 8 & 255u)) * (1.0f / 255.0f);
    return s;
}

struct Texel {
    float depth;      // linear, world units; 0: empty; < 0: outside the image
    float radius;     // pixels of the full-size image
    float thickness;  // half-thickness along the view, in pixels at this depth (world = thickness * lensDepth / focal)
    vec2 offset;      // centre of the splat - centre of the texel, pixels; below kOffsetRadii radii
    vec2 normalPerp;  // the eye-facing normal's components perpendicular to the view direction
    vec3 colour;      // linear
    // Of a tube (ALGORITHMS 1.4, lines): its disc faces the eye, `normalPerp` says how the tube leans instead: t_v
    // t_perp, with t the unit tangent, t_v along the view and t_perp across; `axis` is (tx^2 - ty^2, 2 tx ty), which
    // does not care which way the tangent points. Thickness equals the radius.
    float isRound;         // 1 or 0
    vec2 axis;             // of all else axis.x is 1 where only parts of narrow ribbons were merged
    TexelSurface surface;  // only of frames with materials of points
};

const float kThicknessRadii = 0.25f;  // kappa of ALGORITHMS 1.4

SHARED_FN vec2 perpFromNormal(vec3 n, vec3 v) {
    const float k = (dot(n, v) + n.z) / (1.0f + v.z);
    return vec2(n.x - v.x * k, n.y - v.y * k);
}

// The eye-facing unit normal (n.v <= 0) in camera space.
SHARED_FN vec3 normalFromPerp(vec2 p, vec3 v) {
    const float z = -sqrt(max(1.0f - p.x * p.x - p.y * p.y, 0.0f));
    const float k = z - (v.x * p.x + v.y * p.y) / (1.0f + v.z);
    return vec3(p.x + v.x * k, p.y + v.y * k, (1.0f + v.z) * k - z);
}

// Unit view direction of the image point that lies (x, y) px from the principal point.
SHARED_FN vec3 viewDirection(float x, float y, Lens lens) {
    const float focal = lens.focal;
    const float inverse = 1.0f / sqrt(x * x + y * y + focal * focal);
    return vec3(lens.isOrthographic ? 0.0f : x * inverse, lens.isOrthographic ? 0.0f : y * inverse,
                lens.isOrthographic ? 1.0f : focal * inverse);
}

// Slope of a plane on the image, 1/px: d(1/Z) * cz per pixel. (x, y): its disc's centre, px from the principal point;
// `tilt`: tangent of the angle between normal and view, over the sine of it (1 / cosine where nothing is floored).
// Orthographic: -dZ per pixel, as everything is seen where x and y are 0.
SHARED_FN vec2 planeSlope(vec2 normalPerp, float tilt, float placeX, float placeY, Lens lens) {
    const float focal = lens.focal;
    const float x = lens.isOrthographic ? 0.0f : placeX;
    const float y = lens.isOrthographic ? 0.0f : placeY;
    const float inverse = 1.0f / sqrt(x * x + y * y + focal * focal);
    const float vx = x * inverse;
    const float vy = y * inverse;
    const float turn = (vx * normalPerp.x + vy * normalPerp.y) / (1.0f + focal * inverse);
    return vec2((vx - (normalPerp.x - vx * turn) * tilt) * inverse, (vy - (normalPerp.y - vy * turn) * tilt) * inverse);
}

// Of the ellipse that is drawn: an edge-on splat stays half a pixel wide to each side. That of a tube faces the eye.
SHARED_FN vec2 ellipseSlope(vec2 normalPerp, float isRound, float radius, float x, float y, Lens lens) {
    const float flat_ = 1.0f - isRound;
    const float px = normalPerp.x * flat_;
    const float py = normalPerp.y * flat_;
    const float sine2 = px * px + py * py;
    const float floor2 = 0.25f / (radius * radius);
    const float facing2 = min(max(1.0f - sine2, floor2), 1.0f);
    const float tilt = sqrt(max(1.0f - facing2, 0.0f) / (max(sine2, 1.0e-12f) * facing2));
    return planeSlope(vec2(px, py), tilt, x, y, lens);
}

// rho^2 of the image point (dx, dy) px from the centre (x, y) of a disc: inside the ellipse iff <= 1.
const float kOffDisc = 3.0e38f;
SHARED_FN float discRho2(vec2 slope, float radius, float placeX, float placeY, Lens lens, float dx, float dy) {
    const float x = lens.isOrthographic ? 0.0f : placeX;
    const float y = lens.isOrthographic ? 0.0f : placeY;
    const float along = slope.x * dx + slope.y * dy;
    const float ex = dx - along * x;
    const float ey = dy - along * y;
    const float ez = along * lens.focal;
    const float q = (lens.isOrthographic ? 1.0f : 1.0f + along) * radius;
    const float rho2 = (ex * ex + ey * ey + ez * ez) / max(q * q, 1.0e-20f);
    return lens.isOrthographic || along > -0.99f ? rho2 : kOffDisc;  // beyond, the plane is behind the eye
}

// Depth of the texel's plane at the texel's own centre (a tube: its own). Planes that face the eye by less than
// kGrazing count as if they did by that. How far from the centre's depth it may be: of a pyramid's texels, which stand
// for a surface that goes on beside them, what a disc twice as large reaches (or one that is a pixel wide where it is
// seen edge-on); of points that stand alone (`isMerged` is 0) what the disc reaches, or one of half a pixel. Beyond its
// rim the surface may be anywhere, and a plane that is seen nearly edge-on runs away from it.
const float kGrazing = 0.03125f;
SHARED_FN float planeDepth(float depth, float radius, vec2 normalPerp, float offsetX, float offsetY, float isRound,
                           float isMerged, float x, float y, Lens lens) {
    const float sine2 = normalPerp.x * normalPerp.x + normalPerp.y * normalPerp.y;
    const float facing = max(sqrt(max(1.0f - sine2, 0.0f)), kGrazing);
    const vec2 s = planeSlope(normalPerp, 1.0f / facing, x + offsetX, y + offsetY, lens);
    const float beside = isMerged > 0.5f ? max(2.0f * radius, 1.0f / facing) : max(radius, 0.5f);
    const float reach = min(beside / lens.focal, lens.isOrthographic ? 3.0e38f : 0.5f);
    const float along = -(s.x * offsetX + s.y * offsetY);
    const float flat_ = 1.0f - isRound;
    const float nearer = flat_ * min(max(along, -reach), reach);
    // Never before the eye: what is there stays there.
    return lens.isOrthographic ? max(depth - nearer, 0.001f * depth) : depth / (1.0f + nearer);
}

// Leaves are no surface: they have hardly any thickness (half of it, over the radius), so that they are not merged with
// what is behind them, and nothing closes the gaps between them. Not none: of copies of one leaf none is in front.
const float kLeafThickness = 0.0625f;
const float kLeafLimit = 0.125f;
// 1 for leaves.
SHARED_FN float isLeaf(float thickness, float radius) { return thickness < kLeafLimit * radius ? 1.0f : 0.0f; }
// Leaves do, and ribbons too narrow to be filled: those are merged along the ribbon as a surface is.
const float kAllRibbon = 0.999f;
SHARED_FN float letsLightThrough(float thickness, float radius, float isRound, float axisX) {
    return max(isLeaf(thickness, radius), (1.0f - isRound) * axisX > kAllRibbon ? 1.0f : 0.0f);
}

// Everything of a full-size texel but its place and colour. `c`: centre in camera space, `n`: unit normal (any side),
// `radiusWorld`: support radius, world units.
SHARED_FN Texel texelFromSplat(vec3 c, vec3 n, float radiusWorld, Lens lens, float minimumRadius) {
    Texel t;
    const vec3 sight = sightTo(lens, c);
    const float inverseLength = 1.0f / sqrt(dot(sight, sight));
    const vec3 v = vec3(sight.x * inverseLength, sight.y * inverseLength, sight.z * inverseLength);
    const float facing = dot(n, v);
    const float flip = facing > 0.0f ? -1.0f : 1.0f;
    const vec2 perp = perpFromNormal(n, v);
    t.normalPerp = vec2(perp.x * flip, perp.y * flip);
    t.depth = c.z;
    const float radius = max(radiusWorld * lens.focal / lensDepth(lens, c.z), minimumRadius);
    t.radius = min(radius, 16384.0f);
    t.thickness = t.radius * (kThicknessRadii + sqrt(max(1.0f - facing * facing, 0.0f)));
    t.offset = vec2(0.0f, 0.0f);
    t.colour = vec3(0.0f, 0.0f, 0.0f);
    t.isRound = 0.0f;
    t.axis = vec2(0.0f, 0.0f);
    t.surface = noSurface();
    return t;
}

SHARED_END
#endif
