// Fog and aerial perspective: what a ray loses on its way, and gains of the light that is scattered into it. The air is
// even, or thins out with height (exp(-h / H)); its optical depth over a path is a closed form, and neither that nor
// the share that is lost is a difference of numbers that are nearly the same.
#ifndef STIPPLE_SHARED_FOG_H
#define STIPPLE_SHARED_FOG_H
#include "fade.h"
#include "lens.h"
SHARED_BEGIN

// Orthographic views are drawn by an eye that stands nearer than the one that was asked for, from whose plane ways are
// counted.
struct FogConstants {
    vec3 density;         // of each channel at the height of the eye that draws, 1 / world unit
    float inverseHeight;  // 1 / H, 1 / world unit; 0: even
    vec3 colour;          // linear: of what is scattered in
    float advanced;       // orthographic views: how much nearer that one is
    vec3 up;              // camera space
    uint isGrey;          // all channels alike
};

// Heights beyond which air is as at it, of H.
const float kFogMostHeights = 40.0f;

// How far a point at `depth` on the pixel's ray is from the eye (orthographic: from its plane).
SHARED_FN float fogWay(FogConstants f, PixelRay ray, float depth) {
    const float away = depth + (ray.isOrthographic ? f.advanced : 0.0f);
    return away * sqrt(ray.ex * ray.ex + ray.ey * ray.ey + 1.0f);
}

// Optical depth of the way to such a point, per density at the height of the eye that draws.
SHARED_FN float fogPath(FogConstants f, PixelRay ray, float depth) {
    const float away = depth + (ray.isOrthographic ? f.advanced : 0.0f);
    // Heights over H: of where the ray begins, and how much it rises.
    const float before = ray.isOrthographic ? f.up.z * f.advanced : 0.0f;
    const float begin = (f.up.x * ray.ox + f.up.y * ray.oy - before) * f.inverseHeight;
    const float rise = (f.up.x * ray.ex + f.up.y * ray.ey + f.up.z) * away * f.inverseHeight;
    const float most = min(max(rise, -kFogMostHeights), kFogMostHeights);
    // The mean of exp(-h) on the way: (1 - exp(-rise)) / rise, from whichever end is lower.
    const float lower = min(max(begin + min(most, 0.0f), -kFogMostHeights), kFogMostHeights);
    return fogWay(f, ray, depth) * fadeOver(abs(most)) * exp2Of(-1.44269504f * lower);
}

SHARED_END
#endif
