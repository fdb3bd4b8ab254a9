// Wide ribbons by the ray of each pixel: exact coverage, depth and normal in every perspective, twisted or not. A
// segment is the bilinear patch between its ends: c(v) + s w(v), with v from 0 to 1 along the axis, s from -1 to 1
// across it, and both c and w linear in v. (ALGORITHMS 1.4, lines: rays against quads of ribbons.)
#ifndef STIPPLE_SHARED_RIBBON_H
#define STIPPLE_SHARED_RIBBON_H
#include "lens.h"
SHARED_BEGIN

SHARED_FN vec3 crossOf(vec3 a, vec3 b) {
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

// Lengths over the larger radius, so that products of them stay within fp32.
struct Ribbon {
    vec3 a;      // one end of the axis, camera space
    vec3 along;  // to the other end
    vec3 w;      // from the axis to the edge, at a
    vec3 turn;   // what w gains towards the other end
    vec3 n0;     // normals of planes through the eye: see ribbonHit
    vec3 n1;
    vec3 n2;
    float unit;  // the larger radius, world units
};
SHARED_FN Ribbon ribbonOf(vec3 a, vec3 b, vec3 acrossA, vec3 acrossB, float radiusA, float radiusB) {
    Ribbon r;
    r.unit = max(radiusA, radiusB);
    const float inverse = r.unit > 0.0f ? 1.0f / r.unit : 0.0f;
    const float sizeA = radiusA * inverse / sqrt(max(dot(acrossA, acrossA), 1.0e-12f));
    const float sizeB = radiusB * inverse / sqrt(max(dot(acrossB, acrossB), 1.0e-12f));
    r.a = vec3(a.x * inverse, a.y * inverse, a.z * inverse);
    r.along = vec3((b.x - a.x) * inverse, (b.y - a.y) * inverse, (b.z - a.z) * inverse);
    r.w = vec3(acrossA.x * sizeA, acrossA.y * sizeA, acrossA.z * sizeA);
    r.turn = vec3(acrossB.x * sizeB - r.w.x, acrossB.y * sizeB - r.w.y, acrossB.z * sizeB - r.w.z);
    const vec3 aTurn = crossOf(r.a, r.turn);
    const vec3 alongW = crossOf(r.along, r.w);
    r.n0 = crossOf(r.a, r.w);
    r.n1 = vec3(aTurn.x + alongW.x, aTurn.y + alongW.y, aTurn.z + alongW.z);
    r.n2 = crossOf(r.along, r.turn);
    return r;
}

struct RibbonHit {
    float depth;   // kNoRibbon: none
    float along;   // 0 to 1
    float across;  // -1 to 1
};
const float kNoRibbon = 3.0e38f;
// What rounding may add to a ribbon, share of its size: no gap between segments (raster), and no pixel without a place
// on the ribbon that has taken it (texels).
const float kRibbonSlack = 1.0e-5f;
const float kRibbonTexelSlack = 1.0e-3f;

// Where a ray meets the line across the ribbon at `along`, if that is one of its lines. (ox, oy): the ray's origin,
// over the larger radius.
SHARED_FN RibbonHit ribbonLine(Ribbon r, float along, PixelRay ray, float ox, float oy, float slack, float nearPlane) {
    const float ex = ray.ex;
    const float ey = ray.ey;
    const float v = min(max(along, 0.0f), 1.0f);
    const vec3 c = vec3(r.a.x + v * r.along.x, r.a.y + v * r.along.y, r.a.z + v * r.along.z);
    const vec3 w = vec3(r.w.x + v * r.turn.x, r.w.y + v * r.turn.y, r.w.z + v * r.turn.z);
    // Both as seen along the ray: parallel there.
    const float px = ray.isOrthographic ? c.x - ox : c.x - ex * c.z;
    const float py = ray.isOrthographic ? c.y - oy : c.y - ey * c.z;
    const float qx = w.x - ex * w.z;
    const float qy = w.y - ey * w.z;
    const float q2 = qx * qx + qy * qy;
    const float least = (1.0f + slack) * (1.0f + slack) * q2;
    const float across = -(px * qx + py * qy) / max(q2, 1.0e-30f);
    const float depth = (c.z + across * w.z) * r.unit;
    const float isThere = (abs(along - v) <= slack ? 1.0f : 0.0f) * (px * px + py * py <= least ? 1.0f : 0.0f) *
                          (q2 > 0.0f ? 1.0f : 0.0f) * (depth > nearPlane ? 1.0f : 0.0f);
    RibbonHit hit;
    hit.depth = isThere > 0.5f ? depth : kNoRibbon;
    hit.along = v;
    hit.across = across;
    return hit;
}

// The nearest place before the near plane where a ray e = (ex, ey, 1) from the eye meets the ribbon. Eye, ray and the
// line across the ribbon at v lie in one plane where e . (c(v) x w(v)) = 0: a quadratic in v whose coefficients are
// linear in the ray. Along the axis the same with c counted from the ray's origin.
SHARED_FN RibbonHit ribbonHit(Ribbon r, PixelRay ray, float nearPlane, float slack) {
    const float ex = ray.ex;
    const float ey = ray.ey;
    const float ox = r.unit > 0.0f ? ray.ox / r.unit : 0.0f;
    const float oy = r.unit > 0.0f ? ray.oy / r.unit : 0.0f;
    const float ax = r.a.x - ox;
    const float ay = r.a.y - oy;
    const float straight0 = ax * r.w.y - ay * r.w.x;
    const float straight1 = (ax * r.turn.y - ay * r.turn.x) + (r.along.x * r.w.y - r.along.y * r.w.x);
    const float k0 = ray.isOrthographic ? straight0 : ex * r.n0.x + (ey * r.n0.y + r.n0.z);
    const float k1 = ray.isOrthographic ? straight1 : ex * r.n1.x + (ey * r.n1.y + r.n1.z);
    const float k2 = ex * r.n2.x + (ey * r.n2.y + r.n2.z);
    const float inner = k1 * k1 - 4.0f * k2 * k0;
    const float root = sqrt(max(inner, 0.0f));
    const float q = -0.5f * (k1 + (k1 < 0.0f ? -root : root));
    const bool isReal = inner >= -slack * slack * k1 * k1;
    const float v0 = isReal && abs(q) > 0.0f ? k0 / q : -1.0f;
    const float v1 = isReal && abs(k2) > 0.0f ? q / k2 : -1.0f;
    const RibbonHit first = ribbonLine(r, v0, ray, ox, oy, slack, nearPlane);
    const RibbonHit second = ribbonLine(r, v1, ray, ox, oy, slack, nearPlane);
    const bool isFirst = first.depth <= second.depth;
    RibbonHit hit;
    hit.depth = isFirst ? first.depth : second.depth;
    hit.along = isFirst ? first.along : second.along;
    hit.across = isFirst ? first.across : second.across;
    return hit;
}

// Normal of the ribbon at a hit, unit, towards the eye; `v`: direction of the ray, unit.
SHARED_FN vec3 ribbonHitNormal(Ribbon r, RibbonHit hit, vec3 v) {
    const vec3 w = vec3(r.w.x + hit.along * r.turn.x, r.w.y + hit.along * r.turn.y, r.w.z + hit.along * r.turn.z);
    const vec3 t =
        vec3(r.along.x + hit.across * r.turn.x, r.along.y + hit.across * r.turn.y, r.along.z + hit.across * r.turn.z);
    const vec3 n = crossOf(t, w);
    const float size2 = dot(n, n);
    const float inverse = (dot(n, v) > 0.0f ? -1.0f : 1.0f) / sqrt(max(size2, 1.0e-30f));
    const bool isThere = size2 > 1.0e-30f;
    return vec3(isThere ? n.x * inverse : -v.x, isThere ? n.y * inverse : -v.y, isThere ? n.z * inverse : -v.z);
}

// A corner of the patch, camera space: `end` 0 or 1, `side` -1 or 1.
SHARED_FN vec3 ribbonCorner(Ribbon r, float end, float side) {
    return vec3((r.a.x + end * r.along.x + side * (r.w.x + end * r.turn.x)) * r.unit,
                (r.a.y + end * r.along.y + side * (r.w.y + end * r.turn.y)) * r.unit,
                (r.a.z + end * r.along.z + side * (r.w.z + end * r.turn.z)) * r.unit);
}

SHARED_END
#endif
