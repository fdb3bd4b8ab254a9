// From a record in camera space to a texel of the pyramid, and the ellipse test (ALGORITHMS 1.4, common projection).
//
// A texel carries the splat's centre (offset from its texel's centre), linear depth, screen radius, half-thickness and
// the normal as its two components perpendicular to the view direction v (the rotation that takes v to z by the
// shortest way). The ellipse is then division-free:  m^2 |d|^2 + (np.d)^2 <= m^2 R^2,  m^2 = 1 - |np|^2.
#ifndef STIPPLE_SHARED_SPLAT_H
#define STIPPLE_SHARED_SPLAT_H
#include "types.h"
SHARED_BEGIN

struct Texel {
    float depth;      // linear, world units; 0: empty; < 0: outside the image
    float radius;     // pixels of the full-size image
    float thickness;  // half-thickness along the view, in pixels at this depth (world = thickness * depth / focal)
    vec2 offset;      // centre of the splat - centre of the texel, pixels; below three radii
    vec2 normalPerp;  // the eye-facing normal's components perpendicular to the view direction
    vec3 colour;      // linear
    // Of a tube (ALGORITHMS 1.4, lines): its disc faces the eye, `normalPerp` says how the tube leans instead: t_v
    // t_perp, with t the unit tangent, t_v along the view and t_perp across; `axis` is (tx^2 - ty^2, 2 tx ty), which
    // does not care which way the tangent points. Thickness equals the radius.
    float isRound;  // 1 or 0
    vec2 axis;      // of all else axis.x is 1 where only parts of narrow ribbons were merged
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

// Squared facing of an ellipse, floored so that an edge-on splat stays half a pixel wide.
SHARED_FN float facingSquared(vec2 normalPerp, float radius) {
    const float m2 = 1.0f - normalPerp.x * normalPerp.x - normalPerp.y * normalPerp.y;
    const float floor2 = 0.25f / (radius * radius);
    return min(max(m2, floor2), 1.0f);
}

// The normal that the ellipse test takes: that of a tube faces the eye.
SHARED_FN vec2 ellipseNormal(Texel t) {
    const float flat_ = 1.0f - t.isRound;
    return vec2(t.normalPerp.x * flat_, t.normalPerp.y * flat_);
}

// rho^2 of a point at (dx, dy) pixels from the centre: inside the ellipse iff <= 1.
SHARED_FN float ellipseRho2(vec2 normalPerp, float radius, float dx, float dy) {
    const float m2 = facingSquared(normalPerp, radius);
    const float along = normalPerp.x * dx + normalPerp.y * dy;
    return (m2 * (dx * dx + dy * dy) + along * along) / (m2 * radius * radius);
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
SHARED_FN Texel texelFromSplat(vec3 c, vec3 n, float radiusWorld, float focal, float minimumRadius) {
    Texel t;
    const float inverseLength = 1.0f / sqrt(dot(c, c));
    const vec3 v = vec3(c.x * inverseLength, c.y * inverseLength, c.z * inverseLength);
    const float facing = dot(n, v);
    const float flip = facing > 0.0f ? -1.0f : 1.0f;
    const vec2 perp = perpFromNormal(n, v);
    t.normalPerp = vec2(perp.x * flip, perp.y * flip);
    t.depth = c.z;
    const float radius = max(radiusWorld * focal / c.z, minimumRadius);
    t.radius = min(radius, 16384.0f);
    t.thickness = t.radius * (kThicknessRadii + sqrt(max(1.0f - facing * facing, 0.0f)));
    t.offset = vec2(0.0f, 0.0f);
    t.colour = vec3(0.0f, 0.0f, 0.0f);
    t.isRound = 0.0f;
    t.axis = vec2(0.0f, 0.0f);
    return t;
}

SHARED_END
#endif
