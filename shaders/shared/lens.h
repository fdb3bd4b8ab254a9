// How places become pixels, in perspective or orthographic: a place (x, y, z) of camera space is seen focal / w px a
// unit from the principal point, with w = z in perspective and 1 in orthographic views (lensDepth). A pixel's ray leads
// from o = (ox, oy, 0) along (ex, ey, 1): in perspective from the eye, in orthographic views along the axis, so that
// its parameter is the depth in both. What is linear on the image is 1 / depth in perspective and the depth itself in
// orthographic views (imageLinear).
//
// isOrthographic is the same for all of a frame: the cpu backend's kernels are compiled once for each, shaders branch.
#ifndef STIPPLE_SHARED_LENS_H
#define STIPPLE_SHARED_LENS_H
#include "types.h"
SHARED_BEGIN

struct Lens {
    float focal;  // pixels; orthographic: pixels per world unit
    bool isOrthographic;
};
SHARED_FN Lens lensOf(float focal, bool isOrthographic) {
    Lens l;
    l.focal = focal;
    l.isOrthographic = isOrthographic;
    return l;
}

// What the size of an image is divided by.
SHARED_FN float lensDepth(Lens l, float z) { return l.isOrthographic ? 1.0f : z; }
// From the eye towards a place, of any length.
SHARED_FN vec3 sightTo(Lens l, vec3 c) {
    return vec3(l.isOrthographic ? 0.0f : c.x, l.isOrthographic ? 0.0f : c.y, l.isOrthographic ? 1.0f : c.z);
}
SHARED_FN float imageLinear(Lens l, float z) { return l.isOrthographic ? z : 1.0f / z; }
// And back; the same formula, as either is its own inverse.
SHARED_FN float depthOfLinear(Lens l, float linear) { return l.isOrthographic ? linear : 1.0f / linear; }

struct PixelRay {
    float ox;
    float oy;
    float ex;
    float ey;
    bool isOrthographic;
};
// (x, y): the pixel, px from the principal point, over the focal length.
SHARED_FN PixelRay pixelRay(Lens l, float x, float y) {
    PixelRay r;
    r.ox = l.isOrthographic ? x : 0.0f;
    r.oy = l.isOrthographic ? y : 0.0f;
    r.ex = l.isOrthographic ? 0.0f : x;
    r.ey = l.isOrthographic ? 0.0f : y;
    r.isOrthographic = l.isOrthographic;
    return r;
}
SHARED_FN vec3 rayDirection(PixelRay r) { return vec3(r.ex, r.ey, 1.0f); }
// A place as counted from the ray's origin.
SHARED_FN vec3 fromRay(PixelRay r, vec3 c) {
    return vec3(r.isOrthographic ? c.x - r.ox : c.x, r.isOrthographic ? c.y - r.oy : c.y, c.z);
}
// The place on the ray at a depth.
SHARED_FN vec3 alongRay(PixelRay r, float z) {
    return vec3(r.isOrthographic ? r.ox : r.ex * z, r.isOrthographic ? r.oy : r.ey * z, z);
}

SHARED_END
#endif
