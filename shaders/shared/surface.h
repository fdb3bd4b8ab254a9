// The surface buffer: what is seen at a pixel, whichever reconstruction filled it, in 16 bytes. What lights it reads
// nothing else (but the emission of triangles, which lies beside it).
#ifndef STIPPLE_SHARED_SURFACE_H
#define STIPPLE_SHARED_SURFACE_H
#include "splat.h"
SHARED_BEGIN

struct SurfaceWords {
    float depth;    // linear, world units; 0: nothing
    uint normal;    // octahedral 16 + 16, camera space, towards the eye
    uint albedo;    // packColour
    uint material;  // metallic 8 | roughness 8 | occlusion 8 | flags
};
const uint kPixelTriangle = 0x80000000u;
const uint kPixelUnlit = 0x40000000u;
const uint kPixelLeaf = 0x20000000u;      // lets light through
const uint kPixelMaterial = 0x10000000u;  // of points that have a material: lit as triangles are
const uint kPixelOptics = 0x0f000000u;    // of triangles: which of the layer's optics (optics.h); 0: none
const uint kPixelOpticsShift = 24u;
const uint kPixelBlends = 0x0f000000u;   // the last of them: its occlusion is how opaque it is
const uint kPlainSurface = 0x00ffff00u;  // what points are: not metallic, rough, not occluded

// The material word of what splats were merged to: plain where most of it is.
SHARED_FN uint surfaceWord(TexelSurface s) {
    const float inverse = 255.0f / max(s.share, 1.0e-3f);
    const uint metallic = uint(int(min(max(0.0f, s.metallic * inverse), 255.0f) + 0.5f));
    const uint roughness = uint(int(min(max(0.0f, s.roughness * inverse), 255.0f) + 0.5f));
    return s.share > 0.5f ? kPixelMaterial | 0x00ff0000u | metallic | roughness << 8 : kPlainSurface;
}

// How much of what is around a surface reaches it ...
SHARED_FN float wordOcclusion(uint word) {
    return (word & kPixelBlends) == kPixelBlends ? 1.0f : float(int(word >> 16 & 255u)) * (1.0f / 255.0f);
}
// ... and how much of what is behind it it hides.
SHARED_FN float wordOpacity(uint word) {
    return (word & kPixelBlends) == kPixelBlends ? float(int(word >> 16 & 255u)) * (1.0f / 255.0f) : 1.0f;
}

// The nearest code of a unit vector: see octDirection.
SHARED_FN uint octEncode(vec3 n) {
    const float inverse = 1.0f / max(abs(n.x) + abs(n.y) + abs(n.z), 1.0e-20f);
    const float x = n.x * inverse;
    const float y = n.y * inverse;
    const float foldX = (1.0f - abs(y)) * (x >= 0.0f ? 1.0f : -1.0f);
    const float foldY = (1.0f - abs(x)) * (y >= 0.0f ? 1.0f : -1.0f);
    const float u = n.z < 0.0f ? foldX : x;
    const float v = n.z < 0.0f ? foldY : y;
    const uint cu = uint(int(floor((u + 1.0f) * 32767.0f + 0.5f)));
    const uint cv = uint(int(floor((v + 1.0f) * 32767.0f + 0.5f)));
    return cu | cv << 16;
}

SHARED_END
#endif
