// Ribbons and tubes (Marroquim, Kraus, Cavalcanti 2008, section 4; ALGORITHMS 1.4, lines): a segment of a polyline is
// drawn as a line one pixel wide, and each of its pixels becomes a texel of the reconstruction: a disc as wide as the
// curve there, along the surface (ribbon) or facing the eye (tube).
#ifndef STIPPLE_SHARED_CURVE_H
#define STIPPLE_SHARED_CURVE_H
#include "ribbon.h"
#include "splat.h"
#include "tube.h"
SHARED_BEGIN

// Positions are steps of 1/32768 of the node's cell, counted from half a cell before it: a segment belongs to the cell
// of its middle and may reach beyond.
struct CurveVertex {
    uint positionXY;
    uint positionZ;  // z 16 | radius 15, the upper bits of an fp32 in cells | of the first vertex: is a tube
    uint direction;  // octahedral: across a ribbon, along a tube
    uint colour;     // sRGB | of the first vertex: own error code, of the second: octants whose children it stands for
};
struct CurveSegment {
    CurveVertex a;
    CurveVertex b;
};

const float kCurveMargin = 0.5f;  // cells
const float kCurveCells = 2.0f;   // across all positions
const uint kSegmentsPerBlock = 256u;
const float kLineRadius = 0.25f;  // px: of a texel that is a line's own pixel; nothing else is as narrow
const float kNarrow = 0.5f;       // px: a curve of a smaller half-width keeps its own pixels, with some probability

SHARED_FN float curveRadius(CurveVertex v, float edge) {
    return uintBitsToFloat((v.positionZ >> 16 & 0x7fffu) << 16) * edge;
}
SHARED_FN uint curveRadiusCode(float radiusInCells) {
    const uint code = (floatBitsToUint(max(radiusInCells, 0.0f)) + 0x8000u) >> 16;
    return code < 0x7f00u ? code : 0x7f00u;
}
SHARED_FN bool isTube(CurveSegment s) { return s.a.positionZ >> 31 != 0u; }
SHARED_FN uint segmentErrorCode(CurveSegment s) { return s.a.colour >> 24; }
SHARED_FN uint segmentOctants(CurveSegment s) { return s.b.colour >> 24; }

// A segment in camera space.
struct CameraSegment {
    vec3 a;
    vec3 b;
    float radiusA;  // world units
    float radiusB;
    vec3 directionA;  // camera space
    vec3 directionB;
    float isRound;
};

// Projected: image positions, and where on the segment that part begins and ends that lies before the near plane and
// within kCurveGuard pixels of the image's centre. (Beyond, fp32 would lose what a place on the image is.)
struct ScreenSegment {
    float xa;
    float ya;
    float xb;
    float yb;
    float za;
    float zb;
    float from;  // 0 to 1, along the segment
    float to;
    float isThere;  // 0: nothing is left
};
const float kCurveGuard = 16384.0f;

// Narrows [from, to] to where a quantity that is `da` at one end and `db` at the other is positive.
SHARED_FN vec2 cutRange(vec2 range, float da, float db) {
    const float at = abs(da - db) > 0.0f ? da / (da - db) : 0.0f;
    const float first = da < 0.0f ? (db < 0.0f ? 2.0f : at) : 0.0f;
    const float last = db < 0.0f ? at : 1.0f;
    return vec2(max(range.x, first), min(range.y, last));
}
SHARED_FN ScreenSegment projectSegment(vec3 a, vec3 b, Lens lens, float cx, float cy, float nearPlane) {
    const float slopeA = kCurveGuard / lens.focal * lensDepth(lens, a.z);
    const float slopeB = kCurveGuard / lens.focal * lensDepth(lens, b.z);
    vec2 range = cutRange(vec2(0.0f, 1.0f), a.z - nearPlane, b.z - nearPlane);
    range = cutRange(range, slopeA - a.x, slopeB - b.x);
    range = cutRange(range, slopeA + a.x, slopeB + b.x);
    range = cutRange(range, slopeA - a.y, slopeB - b.y);
    range = cutRange(range, slopeA + a.y, slopeB + b.y);
    ScreenSegment s;
    s.isThere = range.x < range.y ? 1.0f : 0.0f;
    s.from = min(range.x, 1.0f);
    s.to = max(range.y, 0.0f);
    s.za = max(a.z + s.from * (b.z - a.z), nearPlane);
    s.zb = max(a.z + s.to * (b.z - a.z), nearPlane);
    const float ka = lens.focal / lensDepth(lens, s.za);
    const float kb = lens.focal / lensDepth(lens, s.zb);
    s.xa = (a.x + s.from * (b.x - a.x)) * ka + cx;
    s.ya = (a.y + s.from * (b.y - a.y)) * ka + cy;
    s.xb = (a.x + s.to * (b.x - a.x)) * kb + cx;
    s.yb = (a.y + s.to * (b.y - a.y)) * kb + cy;
    return s;
}

// The place on the segment that is seen nearest to an image point, 0 to 1 along the whole of it.
SHARED_FN float segmentParameter(ScreenSegment s, float x, float y, Lens lens) {
    const float dx = s.xb - s.xa;
    const float dy = s.yb - s.ya;
    const float length2 = dx * dx + dy * dy;
    const float across = ((x - s.xa) * dx + (y - s.ya) * dy) / max(length2, 1.0e-8f);
    const float u = min(max(across, 0.0f), 1.0f);
    const float t = lens.isOrthographic ? u : u * s.za / max((1.0f - u) * s.zb + u * s.za, 1.0e-30f);
    return s.from + t * (s.to - s.from);
}

// Half-width across the line of sight, px: what is seen of a ribbon depends on how it faces the eye. `c`: a place on
// the segment, `t`: unit tangent, `w`: across the ribbon. With m the normal of the plane through the eye and the
// segment, the image stretches what lies along m by 1 / sqrt(1 - m_z^2) beside the middle of a wide picture.
SHARED_FN float seenHalfWidth(vec3 c, float radius, vec3 t, vec3 w, float isRound, Lens lens) {
    const vec3 sight = sightTo(lens, c);
    const float inverse = 1.0f / sqrt(max(dot(sight, sight), 1.0e-30f));
    const vec3 v = vec3(sight.x * inverse, sight.y * inverse, sight.z * inverse);
    const float tv = dot(t, v);
    const float sine = sqrt(max(1.0f - tv * tv, 1.0e-6f));
    const vec3 m = crossOf(t, w);
    const float facing = abs(dot(m, v)) / sqrt(max(dot(m, m), 1.0e-12f));
    const float share = isRound > 0.5f ? 1.0f : min(facing / sine, 1.0f);
    const float mz = (v.x * t.y - v.y * t.x) / sine;
    const float stretch2 = max(1.0f - mz * mz, v.z * v.z);  // m lies across v, so that it is no less
    return radius * share * lens.focal / (lensDepth(lens, c.z) * sqrt(max(stretch2, 1.0e-6f)));
}

SHARED_FN vec3 segmentTangent(CameraSegment s) {
    const vec3 d = vec3(s.b.x - s.a.x, s.b.y - s.a.y, s.b.z - s.a.z);
    const float length2 = dot(d, d);
    const float inverse = length2 > 0.0f ? 1.0f / sqrt(length2) : 0.0f;
    return vec3(d.x * inverse, d.y * inverse, d.z * inverse);
}

// Seen half-width at one end of what is left of a segment, px.
SHARED_FN float endHalfWidth(CameraSegment s, float place, vec3 direction, Lens lens, float nearPlane) {
    const vec3 c = vec3(s.a.x + place * (s.b.x - s.a.x), s.a.y + place * (s.b.y - s.a.y),
                        max(s.a.z + place * (s.b.z - s.a.z), nearPlane));
    return seenHalfWidth(c, s.radiusA + place * (s.radiusB - s.radiusA), segmentTangent(s), direction, s.isRound, lens);
}
// The larger radius of the ends, px: decides whether a curve is filled or reconstructed, however it faces the eye.
// Where nothing of the axis is left, what is seen of the curve is wide.
SHARED_FN float widestRadius(CameraSegment s, ScreenSegment on, Lens lens) {
    const float a = (s.radiusA + on.from * (s.radiusB - s.radiusA)) / lensDepth(lens, on.za);
    const float b = (s.radiusA + on.to * (s.radiusB - s.radiusA)) / lensDepth(lens, on.zb);
    return on.isThere < 0.5f ? 3.0e38f : max(a, b) * lens.focal;
}

// May anything of a curve lie before the near plane and inside the picture's four sides, though its axis does not?
// (1 or 0; by the balls around its places.)
SHARED_FN float curveReaches(CameraSegment s, Lens lens, float cx, float cy, float width, float height,
                             float nearPlane) {
    const float focal = lens.focal;
    const float lean = lens.isOrthographic ? 0.0f : 1.0f;  // of the picture's sides
    const float left = 1.0f / sqrt(focal * focal + lean * (cx * cx));
    const float right = 1.0f / sqrt(focal * focal + lean * ((width - cx) * (width - cx)));
    const float top = 1.0f / sqrt(focal * focal + lean * (cy * cy));
    const float bottom = 1.0f / sqrt(focal * focal + lean * ((height - cy) * (height - cy)));
    const float wa = lensDepth(lens, s.a.z);
    const float wb = lensDepth(lens, s.b.z);
    const float l = max((focal * s.a.x + cx * wa) * left + s.radiusA, (focal * s.b.x + cx * wb) * left + s.radiusB);
    const float r = max(((width - cx) * wa - focal * s.a.x) * right + s.radiusA,
                        ((width - cx) * wb - focal * s.b.x) * right + s.radiusB);
    const float t = max((focal * s.a.y + cy * wa) * top + s.radiusA, (focal * s.b.y + cy * wb) * top + s.radiusB);
    const float b = max(((height - cy) * wa - focal * s.a.y) * bottom + s.radiusA,
                        ((height - cy) * wb - focal * s.b.y) * bottom + s.radiusB);
    const float n = max(s.a.z + s.radiusA, s.b.z + s.radiusB) - nearPlane;
    return min(min(min(l, r), min(t, b)), n) > 0.0f ? 1.0f : 0.0f;
}
// Is a curve filled by its pixels' rays (1 or 0)?
SHARED_FN float isFilled(CameraSegment s, ScreenSegment on, Lens lens, float exactCurves) {
    return widestRadius(s, on, lens) >= exactCurves ? 1.0f : 0.0f;
}

// Normal of a tube too narrow to show its roundness: the one whose light is that of the whole, sqrt(1 - (l t)^2), bent
// to the eye where it turns away. `t`: tangent, `v`: view direction, `l`: towards the light; unit.
SHARED_FN vec3 narrowTubeNormal(vec3 t, vec3 v, vec3 l) {
    const float along = dot(l, t);
    vec3 n = vec3(l.x - along * t.x, l.y - along * t.y, l.z - along * t.z);
    const float away = max(dot(n, v), 0.0f);
    n = vec3(n.x - away * v.x, n.y - away * v.y, n.z - away * v.z);
    const float length2 = dot(n, n);
    const float inverse = 1.0f / sqrt(max(length2, 1.0e-12f));
    const bool isThere = length2 > 1.0e-6f;  // else the light comes along the tube
    return vec3(isThere ? n.x * inverse : -v.x, isThere ? n.y * inverse : -v.y, isThere ? n.z * inverse : -v.z);
}

// How far a narrow tube's surface lies before its axis: radius / sine of its side (`sine2`: between tube and view), a
// radius of the end that is seen along the axis. Off the surface by no more than a radius.
SHARED_FN float tubeFront(float radius, float sine2, float distance) {
    const float side = min(4.0f * sine2, 1.0f);
    const float front = 1.0f + side * (1.0f / max(sqrt(max(sine2, 0.0f)), 0.5f) - 1.0f);
    return min(front * radius, 0.9f * distance);
}

// Length of the sight to a place; in orthographic views the eye is infinitely far away.
SHARED_FN float sightLength(Lens lens, vec3 c) {
    return lens.isOrthographic ? 1.0e30f : sqrt(max(dot(c, c), 1.0e-30f));
}
// What a curve's depth is made of where it is drawn as a line: that of its axis, as it is linear on the image, and
// what brings it from there to its surface. `t`: the axis' unit tangent.
SHARED_FN float surfaceStep(Lens lens, vec3 c, vec3 t, float radius, float isRound) {
    const vec3 sight = sightTo(lens, c);
    const float distance = sightLength(lens, c);
    const float tv = lens.isOrthographic ? t.z : dot(t, sight) / distance;
    const float front = tubeFront(radius, 1.0f - tv * tv, distance);
    const float nearer = lens.isOrthographic ? -front : 1.0f - front / distance;
    return isRound > 0.5f ? nearer : (lens.isOrthographic ? 0.0f : 1.0f);
}
SHARED_FN float lineDepth(Lens lens, float linear, float surface, float nearPlane) {
    return lens.isOrthographic ? max(linear + surface, nearPlane) : surface / linear;
}

// Everything of the texel at a place on the segment but its offset from the pixel and its colour. `support`: radius of
// the reconstruction / own radius; `light`: direction of the sun, for what is narrower than a pixel.
SHARED_FN Texel texelFromCurve(CameraSegment s, float place, float support, Lens lens, float nearPlane, vec3 light) {
    const vec3 c =
        vec3(s.a.x + place * (s.b.x - s.a.x), s.a.y + place * (s.b.y - s.a.y), s.a.z + place * (s.b.z - s.a.z));
    const float z = max(c.z, nearPlane);
    const float radius = s.radiusA + place * (s.radiusB - s.radiusA);
    const float distance = sightLength(lens, c);
    const vec3 v = vec3(lens.isOrthographic ? 0.0f : c.x / distance, lens.isOrthographic ? 0.0f : c.y / distance,
                        lens.isOrthographic ? 1.0f : c.z / distance);
    const vec3 own = segmentTangent(s);
    const vec3 d = vec3(s.directionA.x + place * (s.directionB.x - s.directionA.x),
                        s.directionA.y + place * (s.directionB.y - s.directionA.y),
                        s.directionA.z + place * (s.directionB.z - s.directionA.z));
    const float halfWidth = seenHalfWidth(vec3(c.x, c.y, z), radius, own, d, s.isRound, lens);
    // Tube: tangents of the vertices, so that bends are round.
    const float inverse = 1.0f / sqrt(max(dot(d, d), 1.0e-12f));
    const vec3 t = vec3(d.x * inverse, d.y * inverse, d.z * inverse);
    const float tv = dot(t, v);
    const vec2 across = perpFromNormal(t, v);
    const float sine2 = max(1.0f - tv * tv, 0.0f);
    const float reach = min(radius / distance, 0.9f);
    const float front = tubeFront(radius, sine2, distance);
    const float roundRadius = radius * lens.focal / (lensDepth(lens, z) * sqrt(1.0f - reach * reach));
    const vec3 m = crossOf(own, d);
    const float inverseM = 1.0f / sqrt(max(dot(m, m), 1.0e-12f));
    const Texel flat_ =
        texelFromSplat(vec3(c.x, c.y, z), vec3(m.x * inverseM, m.y * inverseM, m.z * inverseM), radius, lens, kNarrow);
    const bool isTube_ = s.isRound > 0.5f;
    const float wide = min((isTube_ ? roundRadius : flat_.radius) * support, 16384.0f);
    Texel r = flat_;
    const float surface = lens.isOrthographic ? z - front : z * (1.0f - front / distance);
    r.depth = isTube_ ? max(surface, nearPlane) : z;
    r.radius = halfWidth < kNarrow ? kLineRadius : wide;
    r.thickness = isTube_ ? r.radius : flat_.thickness;
    const vec2 narrow = perpFromNormal(narrowTubeNormal(t, v, light), v);
    // Conditions as numbers: see pushTexel.
    const bool isRound = s.isRound * (halfWidth >= kNarrow ? 1.0f : 0.0f) > 0.5f;
    const vec2 plain = vec2(isTube_ ? narrow.x : flat_.normalPerp.x, isTube_ ? narrow.y : flat_.normalPerp.y);
    r.normalPerp = vec2(isRound ? tv * across.x : plain.x, isRound ? tv * across.y : plain.y);
    r.isRound = isRound ? 1.0f : 0.0f;
    const float ribbon = 1.0f - s.isRound;
    r.axis =
        vec2(isRound ? across.x * across.x - across.y * across.y : ribbon, isRound ? 2.0f * across.x * across.y : 0.0f);
    return r;
}

// A number of a segment's own, the same in every cut: which pixels a narrow curve takes must not change when others
// come or go.
SHARED_FN uint curveRank(CurveSegment s) {
    return s.a.positionXY * 0x9e3779b1u ^ s.b.positionXY * 0x85ebca6bu ^ (s.a.positionZ & 0xffffu) * 0xc2b2ae35u ^
           (s.b.positionZ & 0xffffu) * 0x27d4eb2fu;
}

// Does a curve narrower than a pixel take this one? A number in [0, 1) for each pixel, curve and frame of a series: of
// a curve and a pixel those of frames go round by the golden ratio, so that N of them are off by about 1/N and not by
// the root of it.
SHARED_FN float coverageThreshold(uint pixel, uint rank, uint seed) {
    uint h = pixel * 0x9e3779b1u ^ rank * 0x85ebca6bu;
    h ^= h >> 16;
    h *= 0x7feb352du;
    h ^= h >> 15;
    h *= 0x846ca68bu;
    h ^= h >> 16;
    h += seed * 0x9e3779b9u;
    return float(int(h >> 8)) * (1.0f / 16777216.0f);
}

// Normal across the view and depth of a tube's surface at a pixel, from the reconstructed texel: `offset` leads from
// the pixel to the axis. Near the end of a tube that is seen along its axis it is a sphere.
struct TubeSurface {
    vec2 normalPerp;
    float depth;
};
SHARED_FN TubeSurface tubeSurface(Texel t, Lens lens) {
    const float inverseFocal = 1.0f / lens.focal;
    const float inverseRadius = 1.0f / max(t.radius, kNarrow);
    const bool isWide = t.radius > kNarrow;
    float x = isWide ? -t.offset.x * inverseRadius : 0.0f;
    float y = isWide ? -t.offset.y * inverseRadius : 0.0f;
    const float sine2 = sqrt(t.axis.x * t.axis.x + t.axis.y * t.axis.y);
    const float inverse = 1.0f / max(sine2, 1.0e-6f);
    const float cos2 = t.axis.x * inverse;
    const float sin2 = t.axis.y * inverse;
    const bool isFlat = cos2 > 0.0f;
    const float first = sqrt(max(0.5f * (1.0f + abs(cos2)), 0.25f));
    const float second = 0.5f * sin2 / first;
    const float ax = isFlat ? first : second;
    const float ay = isFlat ? second : first;
    const float q = x * x + y * y;
    const float shrink = q > 1.0f ? 1.0f / sqrt(q) : 1.0f;
    x *= shrink;
    y *= shrink;
    // Between the ball of an end that is seen along its axis and the side of a cylinder, of which what the centre is
    // off along the axis says nothing. (A mean of two normals: never longer than 1.)
    const float along = x * ax + y * ay;
    const float round_ = 1.0f - min(4.0f * sine2, 1.0f);
    const float wx = x - ax * along;
    const float wy = y - ay * along;
    const float ball = sqrt(max(1.0f - x * x - y * y, 0.0f));
    const float rise = sqrt(max(1.0f - wx * wx - wy * wy, 0.0f));
    const float sine = sqrt(sine2);
    const float lean = (1.0f - round_) * rise / max(sine, 0.5f);
    TubeSurface s;
    s.normalPerp =
        vec2(wx + round_ * ax * along + lean * t.normalPerp.x, wy + round_ * ay * along + lean * t.normalPerp.y);
    const float deeper = round_ * (1.0f - ball) + (1.0f - round_) * (1.0f - rise) / max(sine, 0.5f);
    const float behind = min(deeper, 2.0f) * t.radius * inverseFocal;
    s.depth = lens.isOrthographic ? t.depth + behind : t.depth * (1.0f + behind);
    return s;
}

// What a filled curve shows at a pixel.
struct FilledPixel {
    float depth;  // kNoDepth: the ray passes by
    vec2 normalPerp;
    float place;
};
// A tube at the pixel of a ray.
SHARED_FN FilledPixel tubePixel(CameraSegment s, PixelRay ray, float nearPlane) {
    const float ex = ray.ex;
    const float ey = ray.ey;
    const Tube tube = tubeOf(s.a, s.b, s.radiusA, s.radiusB);
    const TubeHit hit = tubeHit(tube, ray, nearPlane, false);
    const float inverse = 1.0f / sqrt(ex * ex + ey * ey + 1.0f);
    const vec3 v = vec3(ex * inverse, ey * inverse, inverse);
    FilledPixel p;  // where rounding lets the ray pass by: a rim is no nearer to anything
    p.depth = hit.depth;
    p.normalPerp = perpFromNormal(tubeNormal(tube, hit, s.directionA, s.directionB, v), v);
    p.place = hit.place;
    return p;
}

// A ribbon at the pixel of a ray.
SHARED_FN FilledPixel ribbonPixel(CameraSegment s, PixelRay ray, float nearPlane) {
    const float ex = ray.ex;
    const float ey = ray.ey;
    const Ribbon ribbon = ribbonOf(s.a, s.b, s.directionA, s.directionB, s.radiusA, s.radiusB);
    const RibbonHit hit = ribbonHit(ribbon, ray, nearPlane, kRibbonTexelSlack);
    const float inverse = 1.0f / sqrt(ex * ex + ey * ey + 1.0f);
    const vec3 v = vec3(ex * inverse, ey * inverse, inverse);
    FilledPixel p;
    p.depth = hit.depth;
    p.normalPerp = perpFromNormal(ribbonHitNormal(ribbon, hit, v), v);
    p.place = hit.along;
    return p;
}

// What a pixel of a curve shows that is not filled. `on`: the segment projected with the pixel's centre as the origin.
struct CurvePixel {
    Texel texel;
    float place;  // along the segment, 0 to 1
};
SHARED_FN CurvePixel curvePixel(CameraSegment s, ScreenSegment on, float support, Lens lens, float cx, float cy,
                                float nearPlane, vec3 light) {
    CurvePixel r;
    r.place = segmentParameter(on, 0.0f, 0.0f, lens);
    r.texel = texelFromCurve(s, r.place, support, lens, nearPlane, light);
    const vec3 c = vec3(s.a.x + r.place * (s.b.x - s.a.x), s.a.y + r.place * (s.b.y - s.a.y),
                        max(s.a.z + r.place * (s.b.z - s.a.z), nearPlane));
    const float w = lensDepth(lens, c.z);
    // A line lies where its axis does: beside it the plane of a ribbon seen edge-on runs away from it.
    const float isWide = r.texel.radius > kLineRadius ? 1.0f : 0.0f;
    r.texel.offset = vec2(isWide * (c.x * lens.focal / w + cx), isWide * (c.y * lens.focal / w + cy));
    r.texel.colour = vec3(0.0f, 0.0f, 0.0f);
    return r;
}

SHARED_END
#endif
