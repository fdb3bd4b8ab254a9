// How the levels of the pyramid are shared out. Its coarse end one workgroup pulls and pushes: dispatches for so few
// texels take longer than their work.
#ifndef STIPPLE_SHARED_PYRAMID_TAIL_H
#define STIPPLE_SHARED_PYRAMID_TAIL_H
#include "types.h"
SHARED_BEGIN

const uint kLevelTile = 8u;  // texels along an edge of what one workgroup pulls or pushes of other levels
// There are groups (GroupCounts) of those levels alone whose texels are no larger than the largest splat: first of
// those that pull fills, then of those that push refines.
const uint kPyramidLevels = 16u;  // of 32,768 pixels
const uint kTailTexels = 4096u;   // of its finest level, at most
const uint kTailLevels = 13u;     // each has half as many texels, or less: 4,096 of one row, 2,048 ... 1

SHARED_END
#endif
