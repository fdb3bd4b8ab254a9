// A texel of the pyramid in five 32-bit words, one plane each:
//   depth     fp32
//   size      radius | thickness, each the upper half of an fp32, rounded (relative 2^-9)
//   offset    2 x 16-bit signed fractions of kOffsetRadii (rounded) radii
//   normal    2 x 16-bit signed fractions of a map of equal areas: at most 0.004 degrees off where the normal stands by
//             up to 89.5 degrees off the view, 0.04 beyond (there fp32 holds no more of the two components)
//   colour    sqrt of linear r 11 | g 11 | b 10 bit: finer than 8-bit sRGB everywhere above 1/500
// and, only in frames with materials of points, a sixth:
//   surface   share 8 | metallic 12 | roughness 12 bit
#ifndef STIPPLE_SHARED_PACK_H
#define STIPPLE_SHARED_PACK_H
#include "splat.h"
#include "splat_size.h"
SHARED_BEGIN

struct PackedTexel {
    float depth;
    uint size;
    uint offset;
    uint normal;
    uint colour;
};

SHARED_FN uint upperHalf(float v) { return (floatBitsToUint(v) + 0x8000u) >> 16; }
SHARED_FN uint packPair(float x, float y) {
    const uint ux = uint(int(floor(min(max(-1.0f, x), 1.0f) * 32767.0f + 32768.5f)));
    const uint uy = uint(int(floor(min(max(-1.0f, y), 1.0f) * 32767.0f + 32768.5f)));
    return ux | uy << 16;
}
SHARED_FN float unpackLow(uint p) { return (float(int(p & 0xffffu)) - 32768.0f) * (1.0f / 32767.0f); }
SHARED_FN float unpackHigh(uint p) { return (float(int(p >> 16)) - 32768.0f) * (1.0f / 32767.0f); }

// Of the components of an eye-facing normal across the view: of the map of equal areas (Lambert), which spreads the
// codes evenly; the components themselves, rounded, would leave 0.36 degrees where the normal is across the view.
SHARED_FN uint packNormal(vec2 perp) {
    const float facing = sqrt(max(1.0f - (perp.x * perp.x + perp.y * perp.y), 0.0f));
    const float shorten = 1.0f / sqrt(1.0f + facing);
    return packPair(perp.x * shorten, perp.y * shorten);
}
SHARED_FN vec2 unpackNormal(uint p) {
    const float x = unpackLow(p);
    const float y = unpackHigh(p);
    const float lengthen = sqrt(max(2.0f - (x * x + y * y), 0.0f));
    return vec2(x * lengthen, y * lengthen);
}

SHARED_FN uint packColour(float r, float g, float b) {
    const uint ur = uint(int(sqrt(min(max(0.0f, r), 1.0f)) * 2047.0f + 0.5f));
    const uint ug = uint(int(sqrt(min(max(0.0f, g), 1.0f)) * 2047.0f + 0.5f));
    const uint ub = uint(int(sqrt(min(max(0.0f, b), 1.0f)) * 1023.0f + 0.5f));
    return ur | ug << 11 | ub << 22;
}
SHARED_FN float unpackRed(uint c) {
    const float s = float(int(c & 2047u)) * (1.0f / 2047.0f);
    return s * s;
}
SHARED_FN float unpackGreen(uint c) {
    const float s = float(int(c >> 11 & 2047u)) * (1.0f / 2047.0f);
    return s * s;
}
SHARED_FN float unpackBlue(uint c) {
    const float s = float(int(c >> 22)) * (1.0f / 1023.0f);
    return s * s;
}

SHARED_FN uint packSurface(TexelSurface s) {
    return uint(int(min(max(0.0f, s.share), 1.0f) * 255.0f + 0.5f)) |
           uint(int(min(max(0.0f, s.metallic), 1.0f) * 4095.0f + 0.5f)) << 8 |
           uint(int(min(max(0.0f, s.roughness), 1.0f) * 4095.0f + 0.5f)) << 20;
}
SHARED_FN TexelSurface unpackSurface(uint p) {
    TexelSurface s;
    s.share = float(int(p & 255u)) * (1.0f / 255.0f);
    s.metallic = float(int(p >> 8 & 4095u)) * (1.0f / 4095.0f);
    s.roughness = float(int(p >> 20)) * (1.0f / 4095.0f);
    return s;
}

SHARED_FN PackedTexel packTexel(Texel t) {
    PackedTexel p;
    p.depth = t.depth;
    p.size = upperHalf(t.radius) | upperHalf(t.thickness) << 16;
    const float inverseRadius = 1.0f / (kOffsetRadii * max(uintBitsToFloat(p.size << 16), 1.0e-30f));
    p.offset = packPair(t.offset.x * inverseRadius, t.offset.y * inverseRadius);
    p.normal = packNormal(t.normalPerp);
    p.colour = packColour(t.colour.x, t.colour.y, t.colour.z);
    return p;
}
SHARED_FN Texel unpackTexel(PackedTexel p) {
    Texel t;
    t.depth = p.depth;
    t.radius = uintBitsToFloat(p.size << 16);
    t.thickness = uintBitsToFloat(p.size & 0xffff0000u);
    t.offset = vec2(unpackLow(p.offset) * kOffsetRadii * t.radius, unpackHigh(p.offset) * kOffsetRadii * t.radius);
    t.normalPerp = unpackNormal(p.normal);
    t.colour = vec3(unpackRed(p.colour), unpackGreen(p.colour), unpackBlue(p.colour));
    t.isRound = 0.0f;
    t.axis = vec2(0.0f, 0.0f);
    t.surface = noSurface();
    return t;
}

// Of frames that may hold tubes. A thickness is never negative: its sign marks a texel of a tube, whose other 15 bits
// and the normal word hold axis 12 + 12 and lean 12 + 11 (the thickness is the radius). Nor is a radius: its sign marks
// what lets light through though it is no leaf.
SHARED_FN uint fixedBits(float v, float scale) {
    return uint(int(floor((min(max(-1.0f, v), 1.0f) + 1.0f) * scale + 0.5f)));
}
SHARED_FN float fixedValue(uint bits, float scale) { return float(int(bits)) / scale - 1.0f; }
SHARED_FN PackedTexel packAnyTexel(Texel t) {
    PackedTexel p = packTexel(t);
    const uint leanX = fixedBits(t.normalPerp.x, 2047.0f);
    const uint leanY = fixedBits(t.normalPerp.y, 1023.0f);
    const uint size = (p.size & 0xffffu) | 0x80000000u | (leanX >> 8) << 27 | leanY << 16;
    const uint normal = fixedBits(t.axis.x, 2047.0f) | fixedBits(t.axis.y, 2047.0f) << 12 | (leanX & 255u) << 24;
    const uint ribbon = t.axis.x > kAllRibbon ? 0x8000u : 0u;
    p.size = t.isRound > 0.5f ? size : p.size | ribbon;
    p.normal = t.isRound > 0.5f ? normal : p.normal;
    return p;
}
SHARED_FN Texel unpackAnyTexel(PackedTexel packed) {
    PackedTexel p = packed;
    p.size = packed.size & 0xffff7fffu;
    Texel t = unpackTexel(p);
    const bool isRound = (p.size & 0x80000000u) != 0u;
    const float leanX = fixedValue((p.size >> 27 & 15u) << 8 | p.normal >> 24, 2047.0f);
    const float leanY = fixedValue(p.size >> 16 & 2047u, 1023.0f);
    t.isRound = isRound ? 1.0f : 0.0f;
    t.thickness = isRound ? t.radius : t.thickness;
    t.normalPerp = vec2(isRound ? leanX : t.normalPerp.x, isRound ? leanY : t.normalPerp.y);
    const float ribbon = (packed.size & 0x8000u) != 0u ? 1.0f : 0.0f;
    t.axis = vec2(isRound ? fixedValue(p.normal & 4095u, 2047.0f) : ribbon,
                  isRound ? fixedValue(p.normal >> 12 & 4095u, 2047.0f) : 0.0f);
    return t;
}

SHARED_END
#endif
