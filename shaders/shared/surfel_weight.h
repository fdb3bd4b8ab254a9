// Weights of surfels (Ren, Pfister & Zwicker 2002, 7): each says by how much a surfel's kernel counts, so that those of
// a surface add up to one without anybody dividing at the pixel.
#ifndef STIPPLE_SHARED_SURFEL_WEIGHT_H
#define STIPPLE_SHARED_SURFEL_WEIGHT_H
#include "ewa.h"
SHARED_BEGIN

// Of a stored byte; above 0, at most 1. Squares: half a step is 0.56 % of a grid's weight (0.49), 1.3 % of a fifth of
// it.
SHARED_FN float surfelWeight(uint code) {
    const float root = float(code) * (1.0f / 255.0f);
    return root * root;
}

// Weights are measured for kernels that end at 2 sigmas; those of others hold more or less of the same surface. Without
// a weight (code 0) a surfel counts as one of a square grid.
SHARED_FN float surfelScale(uint code, float support) {
    const float grid = gridWeight(support);
    return code == 0u ? grid : surfelWeight(code) * (grid / gridWeight(2.0f));
}

SHARED_END
#endif
