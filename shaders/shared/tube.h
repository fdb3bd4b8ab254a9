// Wide tubes by the ray of each pixel: exact coverage, depth and normal from any side, straight along the axis and at
// the rim of wide pictures. A segment is all balls between its two ends, as wide as they are: two balls and the cone
// that touches both.
//
//        .--------.          balls touch the cone at radius * sine from their middles (here sine > 0),
//      (  a        b )  -->  with sine = (radiusA - radiusB) / length
//        '--------'
#ifndef STIPPLE_SHARED_TUBE_H
#define STIPPLE_SHARED_TUBE_H
#include "lens.h"
SHARED_BEGIN

struct Tube {
    vec3 a;
    vec3 b;
    vec3 axis;  // unit
    float span;
    float radiusA;
    float radiusB;
    float sine;  // of the cone's half-angle: it touches the balls at radius * sine from their middles, along the axis
    float cosine;
};
SHARED_FN Tube tubeOf(vec3 a, vec3 b, float radiusA, float radiusB) {
    const vec3 d = vec3(b.x - a.x, b.y - a.y, b.z - a.z);
    Tube t;
    t.a = a;
    t.b = b;
    t.span = sqrt(dot(d, d));
    const float inverse = t.span > 0.0f ? 1.0f / t.span : 0.0f;
    t.axis = vec3(d.x * inverse, d.y * inverse, d.z * inverse);
    t.radiusA = radiusA;
    t.radiusB = radiusB;
    // Of balls one of which holds the other there is no cone.
    t.sine = min(max((radiusA - radiusB) * inverse, -1.0f), 1.0f);
    t.cosine = sqrt(max(1.0f - t.sine * t.sine, 1.0e-12f));
    return t;
}

struct TubeHit {
    float depth;  // kNoDepth: none
    float place;  // on the segment, 0 to 1; of none: where the ray is nearest to the axis
    vec3 normal;  // unit, outwards
    float end;    // -1: of the ball at a, 1: at b, 0: of the cone
};
const float kNoDepth = 3.0e38f;

// Depth where a ray meets a ball, before or behind its middle (`side` -1 or 1), kNoDepth if it does not. `nearest`:
// depth of the ray's place nearest to the middle, `q`: (radius^2 - distance^2 there) / e^2, `y`: that place along the
// tube's axis. What lies inside the cone is no surface: `least` to `most` is what is, along the axis.
SHARED_FN float ballDepth(float nearest, float q, float side, float y, float dy, float least, float most,
                          float nearPlane) {
    const float s = side * sqrt(max(q, 0.0f));
    const float at = y + s * dy;
    const float isThere = (q >= 0.0f ? 1.0f : 0.0f) * (at >= least ? 1.0f : 0.0f) * (at <= most ? 1.0f : 0.0f);
    const float depth = nearest + s;
    return isThere * (depth > nearPlane ? 1.0f : 0.0f) > 0.5f ? depth : kNoDepth;
}

// Is nothing of it beside or behind the eye, so that only what faces the eye can be seen?
SHARED_FN bool isBeforeEye(Tube t, float nearPlane) { return min(t.a.z - t.radiusA, t.b.z - t.radiusB) > nearPlane; }
// So short that places along it may be counted from its first end: their squares, over that of the radius, keep four
// digits.
SHARED_FN bool isShort(Tube t) { return t.span < 30.0f * min(t.radiusA, t.radiusB); }

// The nearest place before the near plane where a ray meets the tube. Everything is counted
// from the ray's own place nearest to what it may meet, so that fp32 loses nothing of thin tubes far away. `isPlain`:
// the tube is short and before the eye, which is less work.
SHARED_FN TubeHit tubeHit(Tube t, PixelRay ray, float nearPlane, bool isPlain) {
    const float ex = ray.ex, ey = ray.ey;
    const vec3 endA = fromRay(ray, t.a);
    const vec3 endB = fromRay(ray, t.b);
    const float e2 = ex * ex + ey * ey + 1.0f;
    const float inverseE2 = 1.0f / e2;
    const float dy = ex * t.axis.x + ey * t.axis.y + t.axis.z;
    const float touchA = t.radiusA * t.sine, touchB = t.span + t.radiusB * t.sine;
    const float slack = 1.0e-4f * (t.radiusA + t.radiusB);  // no gap between balls and cone
    // Balls.
    const float za = (ex * endA.x + ey * endA.y + endA.z) * inverseE2;
    const vec3 oa = vec3(ex * za - endA.x, ey * za - endA.y, za - endA.z);
    const float qa = (t.radiusA * t.radiusA - dot(oa, oa)) * inverseE2;
    const float ya = dot(oa, t.axis);
    const float zb = (ex * endB.x + ey * endB.y + endB.z) * inverseE2;
    const vec3 ob = vec3(ex * zb - endB.x, ey * zb - endB.y, zb - endB.z);
    const float qb = (t.radiusB * t.radiusB - dot(ob, ob)) * inverseE2;
    const float yb = dot(ob, t.axis) + t.span;
    const float frontA = ballDepth(za, qa, -1.0f, ya, dy, -kNoDepth, touchA + slack, nearPlane);
    const float frontB = ballDepth(zb, qb, -1.0f, yb, dy, touchB - slack, kNoDepth, nearPlane);
    const float backA = isPlain ? kNoDepth : ballDepth(za, qa, 1.0f, ya, dy, -kNoDepth, touchA + slack, nearPlane);
    const float backB = isPlain ? kNoDepth : ballDepth(zb, qb, 1.0f, yb, dy, touchB - slack, kNoDepth, nearPlane);
    // Cone: |o + s d| cosine = radiusA - y sine, o and d across the axis. First the ray's place nearest to the axis,
    // or, where it leads along the axis, beside the segment.
    const vec3 d = vec3(ex - dy * t.axis.x, ey - dy * t.axis.y, 1.0f - dy * t.axis.z);
    const float d2 = dot(d, d);
    const float toAxis = -dot(oa, d) / max(d2, 1.0e-12f * e2);
    const float there = min(max(ya + toAxis * dy, -t.radiusA), t.span + t.radiusB);
    const bool isAlong = dy * dy > 0.01f * e2;
    const float z0 = isPlain ? za : za + (isAlong ? (there - ya) / dy : toAxis);
    const vec3 o0 = isPlain ? oa : vec3(ex * z0 - endA.x, ey * z0 - endA.y, z0 - endA.z);
    const float y0 = isPlain ? ya : dot(o0, t.axis);
    const vec3 o = vec3(o0.x - y0 * t.axis.x, o0.y - y0 * t.axis.y, o0.z - y0 * t.axis.z);
    const float slope = t.sine / t.cosine;
    const float k0 = t.radiusA / t.cosine - y0 * slope;
    const float k1 = -dy * slope;
    const float a = d2 - k1 * k1;
    const float b = dot(o, d) - k0 * k1;
    const float c = dot(o, o) - k0 * k0;
    const float inner = b * b - a * c;
    const float root = sqrt(max(inner, 0.0f));
    const float q = -(b + (b < 0.0f ? -root : root));
    const float s0 = abs(a) > 1.0e-30f ? q / a : 0.0f;
    const float s1 = abs(q) > 1.0e-30f ? c / q : s0;
    const float at0 = y0 + s0 * dy;
    const float at1 = y0 + s1 * dy;
    const float isCone = (inner >= 0.0f ? 1.0f : 0.0f) * (t.span > abs(t.radiusA - t.radiusB) ? 1.0f : 0.0f);
    const float is0 = isCone * (at0 >= touchA ? 1.0f : 0.0f) * (at0 <= touchB ? 1.0f : 0.0f) *
                      (k0 + s0 * k1 >= 0.0f ? 1.0f : 0.0f) * (z0 + s0 > nearPlane ? 1.0f : 0.0f);
    const float is1 = isCone * (at1 >= touchA ? 1.0f : 0.0f) * (at1 <= touchB ? 1.0f : 0.0f) *
                      (k0 + s1 * k1 >= 0.0f ? 1.0f : 0.0f) * (z0 + s1 > nearPlane ? 1.0f : 0.0f);
    const float cone0 = is0 > 0.5f ? z0 + s0 : kNoDepth;
    const float cone1 = is1 > 0.5f ? z0 + s1 : kNoDepth;
    const float cone = min(cone0, cone1);
    const float ballA = min(frontA, backA);
    const float ballB = min(frontB, backB);
    TubeHit hit;
    hit.depth = min(min(ballA, ballB), cone);
    const bool isA = ballA <= min(ballB, cone);
    const bool isB = !isA && ballB <= cone;
    const float onCone = cone0 < cone1 ? s0 : s1;
    const float y = y0 + onCone * dy;
    const float along = (y - touchA) / max(touchB - touchA, 1.0e-30f);
    const float onSegment = isA ? 0.0f : isB ? 1.0f : min(max(along, 0.0f), 1.0f);
    hit.place = hit.depth < kNoDepth ? onSegment : min(max(y0 / max(t.span, 1.0e-30f), 0.0f), 1.0f);
    hit.end = isA ? -1.0f : isB ? 1.0f : 0.0f;
    const float sa = hit.depth - za;
    const float sb = hit.depth - zb;
    const float across = t.cosine / max(k0 + onCone * k1, 1.0e-30f);
    const vec3 nc =
        vec3((o.x + onCone * d.x) * across + t.axis.x * t.sine, (o.y + onCone * d.y) * across + t.axis.y * t.sine,
             (o.z + onCone * d.z) * across + t.axis.z * t.sine);
    const vec3 nb =
        vec3(isA ? oa.x + sa * ex : ob.x + sb * ex, isA ? oa.y + sa * ey : ob.y + sb * ey, isA ? oa.z + sa : ob.z + sb);
    const bool isBall = isA || isB;
    const vec3 n = vec3(isBall ? nb.x : nc.x, isBall ? nb.y : nc.y, isBall ? nb.z : nc.z);
    const float inverse = 1.0f / sqrt(max(dot(n, n), 1.0e-30f));
    hit.normal = vec3(n.x * inverse, n.y * inverse, n.z * inverse);
    return hit;
}

// The normal at a hit, bent as the tube is: its vertices' tangents `da` and `db` say how far, and `d`, between them,
// takes the axis's place. Towards the eye, along `v`.
SHARED_FN vec3 tubeNormal(Tube t, TubeHit hit, vec3 da, vec3 db, vec3 v) {
    const vec3 mixed =
        vec3(da.x + hit.place * (db.x - da.x), da.y + hit.place * (db.y - da.y), da.z + hit.place * (db.z - da.z));
    const float inverse = 1.0f / sqrt(max(dot(mixed, mixed), 1.0e-12f));
    const vec3 d = vec3(mixed.x * inverse, mixed.y * inverse, mixed.z * inverse);
    const vec3 n = hit.normal;
    const float nd = dot(n, d);
    // A ball shows what the cones leave of it: between two segments nothing but their common rim.
    const float lean = hit.end > 0.5f ? max(nd, t.sine) : hit.end < -0.5f ? min(nd, t.sine) : t.sine;
    const vec3 w = vec3(n.x - nd * d.x, n.y - nd * d.y, n.z - nd * d.z);
    const float size = sqrt(max(1.0f - lean * lean, 0.0f)) / sqrt(max(dot(w, w), 1.0e-12f));
    const float side = dot(n, v) > 0.0f ? -1.0f : 1.0f;  // the eye may be inside
    const vec3 bent =
        vec3((w.x * size + d.x * lean) * side, (w.y * size + d.y * lean) * side, (w.z * size + d.z * lean) * side);
    const float away = max(dot(bent, v), 0.0f);
    const vec3 r = vec3(bent.x - away * v.x, bent.y - away * v.y, bent.z - away * v.z);
    const float rest = 1.0f / sqrt(max(dot(r, r), 1.0e-12f));
    return vec3(r.x * rest, r.y * rest, r.z * rest);
}

// Largest x / z of what is seen of a ball, in the plane of x and z; kUnbounded where it reaches beside the eye.
const float kUnbounded = 1.0e6f;
SHARED_FN float ballSlope(float x, float z, float radius) {
    const bool isBefore = z > 1.0001f * radius;
    const float root = sqrt(max(x * x + (z - radius) * (z + radius), 0.0f));
    const float slope = (x * z + radius * root) / max((z - radius) * (z + radius), 1.0e-30f);
    return isBefore ? min(slope, kUnbounded) : kUnbounded;
}
// The same of the whole tube: it lies on one side of a plane through the eye if both balls do. (Orthographic: largest
// x.)
SHARED_FN float tubeSlope(Lens lens, float xa, float za, float ra, float xb, float zb, float rb) {
    const float a = ballSlope(xa, za, ra);
    const float b = ballSlope(xb, zb, rb);
    const float larger = max(a, b);
    const float smaller = min(a, b);
    const float size = sqrt(1.0f + smaller * smaller);
    const float other = a <= b ? xb - smaller * zb + rb * size : xa - smaller * za + ra * size;
    const float slope = larger < kUnbounded || other > 0.0f ? larger : smaller;
    return lens.isOrthographic ? max(xa + ra, xb + rb) : slope;
}

SHARED_END
#endif
