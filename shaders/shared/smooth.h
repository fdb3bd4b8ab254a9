// Discs that are wider than a few pixels, drawn exactly, show as facets: each has one colour and one normal. Mode
// `surface` takes those from a pull and push of such discs alone (pyramid.h) and leaves the place where it is: on the
// nearest disc of the pixel, so that the stated error holds whatever is mixed.
#ifndef STIPPLE_SHARED_SMOOTH_H
#define STIPPLE_SHARED_SMOOTH_H
#include "pyramid.h"
SHARED_BEGIN

// 1 where a pixel at `depth` lies on the surface that a reconstructed texel stands for: within twice its thickness, as
// far as two texels are apart at most that the pull merges (`at`: depth of the texel's plane at the pixel). Else its
// mean is of something before or behind.
SHARED_FN float isOfSurface(Texel t, float at, float depth, Lens lens) {
    return t.depth > 0.0f && abs(at - depth) <= 2.0f * thicknessWorld(t, lens, 1.0f / lens.focal) ? 1.0f : 0.0f;
}

SHARED_END
#endif
