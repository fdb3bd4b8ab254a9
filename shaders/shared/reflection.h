// Reflections of the screen: what a smooth surface mirrors of what the picture shows, in the place of its surroundings.
//
// The mirror ray of a pixel is followed across the picture in even steps, its depth by what is linear there (lens.h),
// until it is behind what a pixel shows and was in front of the picture a step before; halvings of that step find the
// place. Met is what the ray is no farther from than depths change there in a pixel; where it is farther behind (twice
// that) it passes, and goes on, as it does where that shows another side than the ray meets (its own surface, a pixel
// on). (Of grazing ground one pixel is far behind the next, of what faces the eye it is not: how long a step is would
// not tell.)
//
//        eye ------> o surface          from o on: in front, in front, behind: between those two it is met
//                     \_ . _ . _ x
//
// How much of the light that is met counts is a product of shares that fade to nothing: with roughness, for rays that
// come back to the eye, at the picture's border, at the end of the way, as it is farther behind, behind several things
// that the ray passes behind, and where that shows another side than the ray meets. So nothing comes or goes at once,
// and what does not count leaves the surroundings where they were.
//
//     added light = mirrorShare x sum of those shares x (light of what is met - light of the surroundings)
#ifndef STIPPLE_SHARED_REFLECTION_H
#define STIPPLE_SHARED_REFLECTION_H
#include "environment.h"
#include "lens.h"
#include "surface.h"
SHARED_BEGIN

struct ReflectionConstants {
    float reach;  // how far rays are followed, world units
    uint steps;   // of the longest rays; shorter ones have one a pixel
};

const float kMirrorRoughest = 0.3f;    // from this roughness on surfaces mirror nothing of the picture ...
const float kMirrorSmoothest = 0.1f;   // ... up to this one they mirror all of it
const float kMirrorLift = 1.0f;        // px that rays begin above their surface
const float kMirrorTowards = 0.9f;     // of the way to the eye's plane
const float kMirrorBorder = 0.0625f;   // of the picture's shorter side: there it fades
const float kMirrorGrazing = 0.0625f;  // cosine to the eye from which on surfaces are as deep as that
const uint kMirrorHalvings = 6u;
const uint kMirrorTries = 4u;  // behind so many things nothing is met

// Does a pixel of that word (surface.h) mirror the picture? `shade`: of the frame.
SHARED_FN bool isMirror(uint word, uint shade) {
    const bool isTriangle = (word & kPixelTriangle) != 0u;
    const bool isLit = isTriangle ? (word & kPixelUnlit) == 0u && (shade & kShadeTriangles) != 0u
                                  : (word & kPixelMaterial) != 0u && (shade & kShadeLit) != 0u;
    return isLit && float(int(word >> 8 & 255u)) < kMirrorRoughest * 255.0f;
}

SHARED_FN float clampedShare(float x) { return min(max(0.0f, x), 1.0f); }

// A ray on the picture, in shares of its way there.
struct MirrorRay {
    vec3 direction;  // camera space, unit
    float x;         // px: where it begins ...
    float y;
    float dx;  // ... and how far it goes
    float dy;
    float linear;  // imageLinear
    float dLinear;
    float steps;
    float onePixel;  // that is this share of the way
    float share;     // how much of what it meets counts at most
};
// Of the surface at `place` with the normal n; the picture is `size` px and has its principal point at `centre`.
SHARED_FN MirrorRay mirrorRay(ReflectionConstants c, Lens lens, vec2 centre, vec2 size, vec3 place, vec3 n, vec3 toEye,
                              float roughness) {
    const vec3 r = mirrorDirection(n, toEye, max(dot(n, toEye), 1.0e-3f));
    const float lift = kMirrorLift * lensDepth(lens, place.z) / lens.focal;
    const vec3 from = vec3(place.x + lift * n.x, place.y + lift * n.y, place.z + lift * n.z);
    const float towards = kMirrorTowards * from.z / max(-r.z, 1.0e-6f);
    const float way = min(c.reach, r.z < 0.0f ? towards : c.reach);
    const vec3 to = vec3(from.x + way * r.x, from.y + way * r.y, from.z + way * r.z);
    const float scaleFrom = lens.focal / lensDepth(lens, from.z);
    const float scaleTo = lens.focal / lensDepth(lens, to.z);
    MirrorRay m;
    m.direction = r;
    m.x = from.x * scaleFrom + centre.x;
    m.y = from.y * scaleFrom + centre.y;
    const float dx = to.x * scaleTo + centre.x - m.x;
    const float dy = to.y * scaleTo + centre.y - m.y;
    // Up to the border.
    const float across = (dx > 0.0f ? size.x - m.x : m.x) / max(abs(dx), 1.0e-20f);
    const float down = (dy > 0.0f ? size.y - m.y : m.y) / max(abs(dy), 1.0e-20f);
    const float inside = clampedShare(min(across, down));
    m.dx = dx * inside;
    m.dy = dy * inside;
    m.linear = imageLinear(lens, from.z);
    m.dLinear = (imageLinear(lens, to.z) - m.linear) * inside;
    const float pixels = max(abs(m.dx), abs(m.dy));
    m.steps = min(floor(pixels) + 1.0f, float(int(c.steps)));
    m.onePixel = 1.0f / max(pixels, 1.0f);
    const float back = dot(r, toEye);
    m.share = clampedShare((kMirrorRoughest - roughness) / (kMirrorRoughest - kMirrorSmoothest)) *
              clampedShare(1.0f - 2.0f * back);
    return m;
}

SHARED_FN float mirrorDepth(Lens lens, float linear, float dLinear, float share) {
    return depthOfLinear(lens, linear + share * dLinear);
}
SHARED_FN int mirrorPixel(float at, float size) { return int(min(max(0.0f, at), size - 1.0f)); }
// How far behind what a pixel shows a ray is; below 0 where it is not.
SHARED_FN float mirrorBehind(float z, float depth) { return depth > 0.0f ? z - depth : -1.0f; }
// How far a ray is from the surface that it went behind, in shares of what it may be where it meets that. `z`: of the
// ray (`zBefore`: one pixel before); `depth`, `facing`: of the pixel where it is behind, its normal's cosine to the
// eye; `next`: the depth of the picture kMirrorAhead on. Into this pixel depths go as they go on from it, but no
// steeper than the normal says: of ground that is exact, of a rim, which lets rays behind, much less than its normal
// has it. (Where nothing is next, it is far.)
const float kMirrorAhead = 2.0f;  // px: of one, a slanted ray may stay in its row
SHARED_FN float mirrorOff(Lens lens, float z, float zBefore, float depth, float facing, float next) {
    const float pixel = lensDepth(lens, depth) / lens.focal;
    const float steepest = sqrt(max(1.0f - facing * facing, 0.0f)) / max(facing, kMirrorGrazing) * pixel;
    const float into = 0.5f * (next > 0.0f ? min(max((depth - next) / kMirrorAhead, -steepest), steepest) : -steepest);
    return abs(z - depth - into) / (abs(z - zBefore) + pixel + abs(into));
}
const float kMirrorFarOff = 2.0f;  // from there on it passes
// Does a ray of that direction meet a surface with the normal n there?
SHARED_FN bool mirrorMeets(float off, vec3 n, vec3 direction) {
    return max(off - kMirrorFarOff, dot(n, direction)) < 0.0f;  // (both are)
}
// How much counts what is met behind so many things that the ray has passed: at the fourth it is not followed on, and
// that must not come at once.
SHARED_FN float mirrorPassed(float things) { return clampedShare((float(int(kMirrorTries)) - things) / 3.0f); }

// What of the light that is met counts. `n`: there; (x, y): px; `off`: mirrorOff, `distance`: how far from its surface
// the ray is.
SHARED_FN float mirrorHit(ReflectionConstants c, vec2 size, vec3 direction, vec3 n, float x, float y, float off,
                          float distance) {
    const float border = kMirrorBorder * min(size.x, size.y);
    const float inside = min(min(x, size.x - x), min(y, size.y - y));
    return clampedShare(kMirrorFarOff - off) * clampedShare(-4.0f * dot(n, direction)) * clampedShare(inside / border) *
           clampedShare(4.0f - 4.0f * distance / c.reach);
}

// The four pixels about a place, number `tap` of them, and its share. Those that turn their back to the ray do not
// count (at the foot of a ball it is the ball itself); the one that is met does.
const float kMirrorCounted = 0.25f;  // which has so much at least
struct MirrorTap {
    int x;
    int y;
    float share;
};
SHARED_FN MirrorTap mirrorTap(vec2 size, float x, float y, uint tap) {
    const float px = min(max(0.0f, x - 0.5f), size.x - 1.0f);
    const float py = min(max(0.0f, y - 0.5f), size.y - 1.0f);
    const int x0 = int(px);
    const int y0 = int(py);
    const float fx = px - float(x0);
    const float fy = py - float(y0);
    MirrorTap t;
    t.x = (tap & 1u) != 0u ? mirrorPixel(float(x0 + 1), size.x) : x0;
    t.y = (tap & 2u) != 0u ? mirrorPixel(float(y0 + 1), size.y) : y0;
    t.share = ((tap & 1u) != 0u ? fx : 1.0f - fx) * ((tap & 2u) != 0u ? fy : 1.0f - fy);
    return t;
}

// What a mirror sees where nothing is in the way.
SHARED_FN vec3 mirrorSurroundings(SHARED_TABLE FrameConstants f, Surface s, vec3 r) {
    vec3 light;
    if (f.hasEnvironment != 0u) {
        const vec3 to = vec3(dot(f.environmentX, r), dot(f.environmentY, r), dot(f.environmentZ, r));
        light = environmentMirror(SHARED_TABLE_USE to, s.roughness, f.environmentSharp);
    } else {
        const float sky = skyMirror(s, r, f.skyDirection);
        light = vec3(sky, sky, sky);
    }
    return vec3(f.ambient * light.x, f.ambient * light.y, f.ambient * light.z);
}
// What is added to the surface's light. `met`: of what is met, less the surroundings, by its share.
SHARED_FN vec3 mirrorAdded(Surface s, vec3 met) {
    const vec3 share = mirrorShare(s, max(dot(s.normal, s.toEye), 1.0e-3f));
    return vec3(s.occlusion * share.x * met.x, s.occlusion * share.y * met.y, s.occlusion * share.z * met.z);
}

SHARED_END
#endif
