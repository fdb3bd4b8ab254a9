// Discs over the levels of a pyramid (mode pullpush-exact; PP-B of ALGORITHMS 1.4): a disc belongs to one texel of one
// level, that of its centre, and reaches at most kLevelTaps texels from there, so that a pixel finds all that may cover
// it in (2 kLevelTaps + 1)^2 texels a level.
#ifndef STIPPLE_SHARED_DISC_LEVEL_H
#define STIPPLE_SHARED_DISC_LEVEL_H
#include "splat_disc.h"
SHARED_BEGIN

const int kLevelTaps = 3;
const int kMostLevels = 17;  // pictures have at most 65,536 pixels each way

// Texels of a level that is `size` = 2^level pixels a texel, along one axis.
SHARED_FN int levelTexels(uint pixels, int level) { return (int(pixels) + (1 << level) - 1) >> level; }

// `level` is -1 where a disc belongs to none: it reaches behind the eye, or its centre is not before it, or it is wider
// than the coarsest level's taps. Centres beside the picture belong to the nearest texel of its border, which is no
// farther from any pixel.
struct LevelPlace {
    int level;
    int x;
    int y;
};
SHARED_FN LevelPlace levelPlace(WideDisc d, FrameConstants f) {
    const Lens lens = frameLens(f);
    const vec2 across = discSlopes(lens, d.centre.x, d.centre.z, d.normal.x, d.normal.z, d.radius);
    const vec2 down = discSlopes(lens, d.centre.y, d.centre.z, d.normal.y, d.normal.z, d.radius);
    const bool isAhead = d.centre.z > f.nearPlane;
    const float scale = f.focal / (isAhead ? lensDepth(lens, d.centre.z) : 1.0f);
    const float x = d.centre.x * scale;
    const float y = d.centre.y * scale;
    const float reachX = max(across.y * f.focal - x, x - across.x * f.focal);
    const float reachY = max(down.y * f.focal - y, y - down.x * f.focal);
    // Half a pixel for what rounding moves.
    const float reach = max(reachX, reachY) + 0.5f;
    LevelPlace p;
    p.level = 0;
    float size = 1.0f;
    while (p.level < kMostLevels && !(reach <= float(kLevelTaps) * size)) {
        size *= 2.0f;
        ++p.level;
    }
    const int columns = levelTexels(f.width, p.level);
    const int rows = levelTexels(f.height, p.level);
    // One texel and what is within its taps of it is all there is of a level beyond the coarsest.
    const bool isHeld = isAhead && p.level < kMostLevels;
    p.x = int(floor(min(max((x + f.centre.x) / size, 0.0f), float(columns - 1))));
    p.y = int(floor(min(max((y + f.centre.y) / size, 0.0f), float(rows - 1))));
    p.level = isHeld ? p.level : -1;
    return p;
}

SHARED_END
#endif
