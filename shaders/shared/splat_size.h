// How wide a point may be drawn.
#ifndef STIPPLE_SHARED_SPLAT_SIZE_H
#define STIPPLE_SHARED_SPLAT_SIZE_H
#include "types.h"
SHARED_BEGIN

// A disc's radius in a picture is at most an eighth of its height, or 64 pixels: a stray point before the camera hides
// no more than that. What it costs: of a surface that is looked at from so near that its points are 47 pixels and more
// apart (90 pixels of radius at 720 rows: 66), discs no longer overlap; gaps between four of them are closed by the
// push all the same, others stay open. Per unit of depth, world units.
const float kSplatShare = 0.125f;
const float kSplatPixels = 64.0f;
SHARED_FN float largestSplat(float focal, uint height) {
    return max(kSplatShare * float(int(height)), kSplatPixels) / focal;
}

SHARED_END
#endif
