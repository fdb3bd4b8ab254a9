// How wide a point may be drawn, and how far beyond the picture points still matter.
#ifndef STIPPLE_SHARED_SPLAT_SIZE_H
#define STIPPLE_SHARED_SPLAT_SIZE_H
#include "record.h"
SHARED_BEGIN

// What no surface joins to others (kFlagScattered: strays, single leaves, wires) is drawn at most a 128th of the
// picture's height wide to each side, or 4 pixels: a stray point before the camera hides no more than that. A surface
// is not capped: from wherever it is looked at, its discs overlap. Per unit of lensDepth, world units.
const float kSplatShare = 0.0078125f;
const float kSplatPixels = 4.0f;
SHARED_FN float largestSplat(uint flags, float focal, uint height) {
    const float scattered = max(kSplatShare * float(int(height)), kSplatPixels) / focal;
    return (flags & kFlagScattered) != 0u ? scattered : 16384.0f / focal;
}

// The pixel of a splat, where p is its centre on the image: that which holds it, or, of one beside the picture whose
// disc reaches in, the nearest at the border: its offset leads out there. -1 where it reaches no pixel. `c`: towards
// the centre (sightTo); `radius`: px. `share`: how far beside the picture, of its reach, squared: below 1 where it
// reaches a pixel, as where x is not -1. `farther`: by what share of its radius a splat counts as deeper where several
// share a pixel: at the border, of those of one surface that which reaches in farthest is kept.
const float kOffsetRadii = 16.0f;  // offsets are kept up to that many radii
struct SplatPixel {
    int x;
    int y;
    float share;
    float farther;
};
SHARED_FN SplatPixel splatPixel(float px, float py, float cx, float cy, float cz, float radius, float width,
                                float height) {
    const float x = min(max(px, 0.0f), width - 1.0f);
    const float y = min(max(py, 0.0f), height - 1.0f);
    const float dx = px - x;
    const float dy = py - y;
    // Off the axis discs look longer.
    const float longer = min(1.25f * sqrt(cx * cx + cy * cy + cz * cz) / cz, kOffsetRadii - 1.0f);
    const float reach = 1.0f + radius * longer;
    const float share = (dx * dx + dy * dy) / (reach * reach);
    const bool isNear = share < 1.0f;
    SplatPixel s;
    s.x = isNear ? int(x) : -1;
    s.y = isNear ? int(y) : -1;
    s.share = share;
    s.farther = isNear ? share : 0.0f;
    return s;
}

// Is a texel of level 0 more than its own pixel, so that it is not shown there for its own sake? Those of splats beside
// the picture are.
SHARED_FN float isBeside(vec2 offset) { return max(abs(offset.x), abs(offset.y)) > 0.75f ? 1.0f : 0.0f; }

SHARED_END
#endif
