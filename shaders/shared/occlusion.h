// Ambient occlusion of what a picture shows: how much of the light from all around a place does not get there.
//
// Horizons in slices through the eye (after Jimenez, Wu, Pesce & Jarabo 2016, Practical real-time strategies for
// accurate indirect occlusion). All that lies on a line of the picture through a place lies in one plane with the eye,
// v being the direction to it. There a normal n has the parts nv = n.v and nt = n.t, and of the light of that plane
//
//        v  n            a(h) = ((sin h)^2 nv + (h - sin h cos h) nt) / 2
//        | /    o        comes from between v and the angle h from it, towards t (on the other side: -nt). Without
//        |/ h .'         anything around, h reaches the plane of the surface. Steps along the line lower it: what lies
//    ----P-------- t     between two horizons is hidden, from afar less: fall(d) = 1 - (d / radius)^2.
//
//     1 - AO = 1/K sum over slices, both sides, steps j: fall(|v_(j-1)|) max(0, a(lowest h so far) - a(h_j))
//
// (What rises between two steps counts as near as the nearer: its near side is not seen. Of two steps, so counted, the
// mean difference from rays is a third of that with the farther.)
//
// A plane has nothing above it: what is flat is open, exactly. Each pixel takes other slices and other steps, by a
// pattern of 4 x 4 pixels that stands still; a mean over that pattern, within the surface, has all of them.
#ifndef STIPPLE_SHARED_OCCLUSION_H
#define STIPPLE_SHARED_OCCLUSION_H
#include "lens.h"
#include "surface.h"
SHARED_BEGIN

struct OcclusionConstants {
    float radius;  // world units
    uint edge;     // px, both ways, between those that are asked for it: 1 or 2
};

const uint kAoPatternEdge = 4u;      // px
const uint kAoSteps = 2u;            // to each side of a slice
const int kAoReach = 2;              // px of the mean, to both sides
const float kAoLeastSine = 0.1f;     // of the elevation below which nothing is hidden: what discs are rough by
const float kAoMostPixels = 128.0f;  // the radius, where it is wider: steps so far apart would miss what is there
const float kAoTolerance = 0.25f;    // of the radius: what is farther off a surface's plane is none of it

// Which of the pattern's 16 a pixel is (ordered dither: neighbours are far apart in it).
SHARED_FN uint aoNumber(uint x, uint y) {
    const uint d = x ^ y;
    return (d & 1u) << 3u | (y & 1u) << 2u | (d & 2u) | (y & 2u) >> 1u;
}
// Angle of its first slice on the picture; the second is at right angles.
SHARED_FN float aoAngle(uint number) { return (float(int(number)) + 0.5f) * (1.57079632679f / 16.0f); }
// Where within their sixteenth its steps are.
SHARED_FN float aoStart(uint number) { return (float(int(number * 7u & 15u)) + 0.5f) * (1.0f / 16.0f); }

// a(h), by the cosine of h. (h - sin h cos h is pi/2 minus a polynomial that is odd in the cosine, to 3e-3: no angle
// has to be found.)
SHARED_FN float aoLight(float cosine, float nv, float nt) {
    const float c2 = cosine * cosine;
    const float arc = 1.5707963f - cosine * (1.9836894f + c2 * (-0.2380263f + c2 * -0.1721545f));
    return 0.5f * ((1.0f - c2) * nv + arc * nt);
}

// A place whose light is asked for.
struct AoPlace {
    vec3 place;
    vec3 normal;
    vec3 toEye;
    float pixels;   // how far the steps lead
    float least;    // square of a quarter of a pixel: what is nearer is the place itself, rounded otherwise
    float inverse;  // of the radius' square
    float share;    // of what is hidden: less where the radius is hardly a pixel
};
// (x, y): the pixel's centre, px from the principal point.
SHARED_FN AoPlace aoPlace(Lens lens, float x, float y, float depth, vec3 n, float radius) {
    const float inverseFocal = 1.0f / lens.focal;
    const PixelRay ray = pixelRay(lens, x * inverseFocal, y * inverseFocal);
    const vec3 d = rayDirection(ray);
    const float length_ = -1.0f / sqrt(dot(d, d));
    AoPlace a;
    a.place = alongRay(ray, depth);
    a.normal = n;
    a.toEye = vec3(d.x * length_, d.y * length_, d.z * length_);
    const float pixels = radius * lens.focal / lensDepth(lens, depth);
    a.pixels = min(pixels, kAoMostPixels);
    const float least = radius * (a.pixels / pixels);
    a.inverse = 1.0f / (least * least);
    a.share = min(max(pixels - 1.0f, 0.0f), 1.0f);
    const float quarter = 0.25f * inverseFocal * lensDepth(lens, depth);
    a.least = quarter * quarter;
    return a;
}
// How far step number `step` goes, of all the way: nearer ones are closer to each other.
SHARED_FN float aoStep(uint step, float start) {
    const float way = (float(int(step)) + start) * (1.0f / float(int(kAoSteps)));
    return way;
}

// A slice, towards one side.
struct AoSide {
    float nv;
    float nt;
    float open;    // light of what is not hidden yet ...
    float hidden;  // ... and of what is
    float before;  // how much counts what the step before has met
};
// Along (x, y) of the image, a unit vector.
SHARED_FN AoSide aoSide(AoPlace a, float x, float y) {
    const float along = x * a.toEye.x + y * a.toEye.y;
    const vec3 t = vec3(x - along * a.toEye.x, y - along * a.toEye.y, -along * a.toEye.z);
    AoSide s;
    s.nv = max(dot(a.normal, a.toEye), 1.0e-3f);
    s.nt = dot(a.normal, t) / sqrt(max(dot(t, t), 1.0e-6f));
    s.open = aoLight(-s.nt / sqrt(s.nv * s.nv + s.nt * s.nt), s.nv, s.nt);
    s.hidden = 0.0f;
    s.before = 1.0f;
    return s;
}
// The other side of the same slice.
SHARED_FN AoSide aoBack(AoSide of) {
    AoSide s = of;
    s.nt = -of.nt;
    s.open = aoLight(of.nt / sqrt(of.nv * of.nv + of.nt * of.nt), s.nv, s.nt);
    return s;
}
// What is seen at `q`; `isThere`: 0 where nothing is.
SHARED_FN AoSide aoRaised(AoSide s, AoPlace a, vec3 q, float isThere) {
    const vec3 v = vec3(q.x - a.place.x, q.y - a.place.y, q.z - a.place.z);
    const float square = dot(v, v);
    const float inverse = 1.0f / sqrt(max(square, a.least));
    const float fall = max(1.0f - square * a.inverse, 0.0f) * isThere;
    const bool isAbove = dot(v, a.normal) * inverse > kAoLeastSine;
    const float light = aoLight(dot(v, a.toEye) * inverse, s.nv, s.nt);
    AoSide next = s;
    next.open = isAbove && fall > 0.0f ? min(s.open, light) : s.open;
    next.hidden = s.hidden + s.before * (s.open - next.open);
    next.before = fall;
    return next;
}

// How the depth of a surface's plane changes by a pixel: over the depth, or (orthographic) as it is.
SHARED_FN vec2 aoSlope(Lens lens, float x, float y, vec3 n) {
    const float inverseFocal = 1.0f / lens.focal;
    const vec3 e = rayDirection(pixelRay(lens, x * inverseFocal, y * inverseFocal));
    const float towards = -max(-(n.x * e.x + n.y * e.y + n.z), 1.0e-2f);
    const float s = inverseFocal / towards;
    return vec2(n.x * s, n.y * s);
}
// How far off a surface's plane is what is none of it, world units.
SHARED_FN float aoTolerance(Lens lens, float depth, float radius) {
    return kAoTolerance * min(radius, kAoMostPixels * (lensDepth(lens, depth) / lens.focal));
}
// What counts a place that is `off` times the slope away and `depth` deep: all of the tolerance on the plane.
SHARED_FN float aoWeight(Lens lens, float ownDepth, float depth, float off, float tolerance) {
    const float onPlane = lens.isOrthographic ? depth + off : depth * (1.0f + off);
    return depth > 0.0f ? max(tolerance - abs(onPlane - ownDepth), 0.0f) : 0.0f;
}
// The word of a surface (surface.h) that so much of the light gets to.
SHARED_FN uint aoMaterial(uint word, float open) {
    const float own = float(int(word >> 16 & 255u));
    if ((word & kPixelBlends) == kPixelBlends) return word;
    return (word & 0xff00ffffu) | uint(int(own * open + 0.5f)) << 16;
}
// Of the mean: what is at both ends is of the same place of the pattern.
SHARED_FN float aoShare(int off) { return off == -kAoReach || off == kAoReach ? 0.5f : 1.0f; }

// Of the tolerance: where nothing that was computed is of a pixel's surface, nothing is hidden.
const float kAoOpenWeight = 1.0e-3f;

SHARED_END
#endif
