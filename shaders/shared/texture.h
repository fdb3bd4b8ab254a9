// Textures as mip pyramids of square tiles with a border, so that a tile can be sampled bilinearly on its own.
#ifndef STIPPLE_SHARED_TEXTURE_H
#define STIPPLE_SHARED_TEXTURE_H
#include "types.h"
SHARED_BEGIN

const uint kTileTexels = 128u;
const uint kTileEdge = 130u;  // with a border of one texel on every side
const uint kTextureLevels = 16u;

const uint kWrapRepeat = 0u;
const uint kWrapMirror = 1u;
const uint kWrapClamp = 2u;

// Level l has ceil(width / 2^l) x ceil(height / 2^l) texels; its tiles stand row by row from firstTile[l] on.
struct TextureInfo {
    uint width;
    uint height;
    uint levels;
    uint wrapU;
    uint wrapV;
    uint isColour;  // sRGB; otherwise numbers
    uint firstTile[kTextureLevels];
};

SHARED_FN uint levelSize(uint size, uint level) {
    const uint s = (size + (1u << level) - 1u) >> level;
    return s > 0u ? s : 1u;
}
SHARED_FN uint tilesAcross(uint size, uint level) { return (levelSize(size, level) + kTileTexels - 1u) / kTileTexels; }

// A coordinate into [0, 1).
SHARED_FN float wrapCoordinate(float u, uint wrap) {
    const float whole = floor(u);
    // (What is the same for all pixels chooses between numbers or bits: of other conditions on it GCC makes no SIMD.)
    const float half2 = 0.5f * whole;
    const float mirrored = half2 - floor(half2) > (wrap == kWrapMirror ? 0.25f : 1.0f) ? 1.0f - (u - whole) : u - whole;
    const uint clamped = wrap == kWrapClamp ? ~0u : 0u;
    const float f =
        uintBitsToFloat((floatBitsToUint(min(max(u, 0.0f), 1.0f)) & clamped) | (floatBitsToUint(mirrored) & ~clamped));
    return min(f, 0.99999994f);
}

// Where a bilinear sample lies (`firstTile`: of the level): tile, the texel (x, y) of the upper left of its four
// (border included), and fractions.
struct TextureTap {
    uint tile;
    uint x;
    uint y;
    float fx;
    float fy;
};
SHARED_FN TextureTap textureTap(TextureInfo t, uint firstTile, uint level, float u, float v) {
    const uint w = levelSize(t.width, level);
    const uint h = levelSize(t.height, level);
    const float x = wrapCoordinate(u, t.wrapU) * float(int(w)) - 0.5f;
    const float y = wrapCoordinate(v, t.wrapV) * float(int(h)) - 0.5f;
    const float x0 = floor(x);
    const float y0 = floor(y);
    const uint px = uint(int(max(x0, 0.0f)));
    const uint py = uint(int(max(y0, 0.0f)));
    const uint tx = px / kTileTexels;
    const uint ty = py / kTileTexels;
    TextureTap tap;
    tap.tile = firstTile + ty * tilesAcross(t.width, level) + tx;
    tap.x = uint(int(x0) + 1 - int(tx * kTileTexels));
    tap.y = uint(int(y0) + 1 - int(ty * kTileTexels));
    tap.fx = x - x0;
    tap.fy = y - y0;
    return tap;
}

// log2 of v >= 1, within 8e-6: exact at powers of two, a polynomial between them.
SHARED_FN float log2Above1(float v) {
    const uint bits = floatBitsToUint(v);
    const float m = uintBitsToFloat((bits & 0x7fffffu) | 0x3f800000u);
    const float p = -1.03158278f + m * (1.05426976f + m * (-0.64552583f + m * (0.20704189f + m * -0.026867003f)));
    return float(int(bits >> 23) - 127) + (m - 1.0f) * (1.0f + (m - 2.0f) * p);
}

// Level of detail of a footprint of `area` texels across (the longer of its two edges), finest level 0.
SHARED_FN float textureLod(float texels) { return log2Above1(min(max(texels, 1.0f), 1.0e9f)); }

// Linear value of an sRGB byte s / 255, within 6e-6 (the formula itself needs a power for each channel of each texel).
SHARED_FN float linearFromByte(float s) {
    const float high =
        0.000909604631f +
        s * (0.033245567f +
             s * (0.510684951f + s * (0.719497524f + s * (-0.438605326f + s * (0.229881938f + s * -0.055619892f)))));
    return s <= 0.04045f ? s * (1.0f / 12.92f) : high;
}

SHARED_END
#endif
