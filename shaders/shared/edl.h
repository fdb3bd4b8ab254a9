// Eye-dome lighting (Boucheny 2009), on logarithms of depth: a pixel is darker where its neighbours are nearer, by
// exp(-strength * mean of max(0, L - L_i)), whatever the scale of the scene.
#ifndef STIPPLE_SHARED_EDL_H
#define STIPPLE_SHARED_EDL_H
#include "fade.h"
#include "frame.h"
#include "surface.h"
SHARED_BEGIN

const uint kEdlScales = 3u;      // at most; each looks twice as far as the one before
const uint kEdlNeighbours = 8u;  // of each
const int kEdlReach = 32;        // px: the farthest neighbour

// Which pixels, beside those that keep their colours: bits.
const uint kEdlPoints = 1u;
const uint kEdlTriangles = 2u;

struct EdlConstants {
    float strength;  // over the number of neighbours
    float perDepth;  // orthographic views: L = perDepth * depth; perspective: 0, and L = log2(depth)
    uint scales;
    uint lit;       // kEdl...: of what is lit, too
    float weight0;  // of the scales: together 1
    float weight1;
    float weight2;
    int straight0;  // px to the neighbours beside and above, of each scale ...
    int straight1;
    int straight2;
    int slanted0;  // ... and along both axes to those across
    int slanted1;
    int slanted2;
};

// Where nothing is, it is far: farther than any surface.
const float kEdlFar = 1.0e30f;
SHARED_FN float edlDepth(float depth, float perDepth) {
    const float away = perDepth > 0.0f ? perDepth * depth : log2Of(max(depth, 1.0e-37f));
    return depth > 0.0f ? away : kEdlFar;
}

// Does it change a pixel with that material word? `shade`: FrameConstants'.
SHARED_FN bool edlConcerns(uint material, uint shade, uint lit) {
    const bool isTriangle = (material & kPixelTriangle) != 0u;
    const uint light = shade & (isTriangle ? kShadeTriangles : kShadeLit);
    const uint anyway = lit & (isTriangle ? kEdlTriangles : kEdlPoints);
    return (light == 0u ? 1u : anyway) != 0u;  // (of conditions that are joined compilers make branches)
}

SHARED_END
#endif
