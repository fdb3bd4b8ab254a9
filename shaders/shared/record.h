// The 16-byte point record and its codes (ARCHITECTURE, "What is stored").
//
//   word 0   x 16 | y 16            position in steps of the node's lattice
//   word 1   z 16 | radius 8 | own error 8
//   word 2   octahedral normal 16 + 16
//   word 3   red 8 | green 8 | blue 8 (sRGB) | flags 8
#ifndef STIPPLE_SHARED_RECORD_H
#define STIPPLE_SHARED_RECORD_H
#include "types.h"
SHARED_BEGIN

struct PointRecord {
    uint positionXY;
    uint positionZRadiusError;
    uint normal;
    uint colour;
};

const uint kFlagTwoSided = 1u;         // the normal's sign is not known: draw both sides, shade with |n.v|
const uint kFlagEstimatedNormal = 2u;  // the normal was not in the file
const uint kFlagNoNormal = 4u;         // no normal at all: faces the viewer
const uint kFlagLeaf = 8u;  // a leaf among leaves, no part of a surface: not merged with others, gaps stay open

const uint kFlagScattered = 16u;  // no surface joins it to others: drawn small

const uint kRecordsPerBlock = 256u;

SHARED_FN uint recordX(PointRecord r) { return r.positionXY & 0xffffu; }
SHARED_FN uint recordY(PointRecord r) { return r.positionXY >> 16; }
SHARED_FN uint recordZ(PointRecord r) { return r.positionZRadiusError & 0xffffu; }
SHARED_FN uint recordRadiusCode(PointRecord r) { return (r.positionZRadiusError >> 16) & 0xffu; }
SHARED_FN uint recordErrorCode(PointRecord r) { return r.positionZRadiusError >> 24; }
SHARED_FN uint recordFlags(PointRecord r) { return r.colour >> 24; }
// Which child cell the record's position lies in: one bit per axis (x 1, y 2, z 4).
SHARED_FN uint recordOctant(PointRecord r) {
    return ((r.positionXY >> 15) & 1u) | ((r.positionXY >> 30) & 2u) | ((r.positionZRadiusError >> 13) & 4u);
}

// Radius = node edge * 2^((code - 255)/16): 16 octaves below the edge, 4.4 % a step, rounded outwards when written.
SHARED_FN float radiusFraction(uint code) { return exp2((float(code) - 255.0f) * 0.0625f); }

// The same without a transcendental function: at most 3 units in the last place off.
SHARED_FN float radiusFractionFast(uint code) {
    const uint e = code + 1777u;  // 127 * 16 - 255
    const float octave = uintBitsToFloat((e >> 4) << 23);
    const float a = (e & 1u) != 0u ? 1.0442737824f : 1.0f;
    const float b = (e & 2u) != 0u ? 1.0905077327f : 1.0f;
    const float c = (e & 4u) != 0u ? 1.1892071150f : 1.0f;
    const float d = (e & 8u) != 0u ? 1.4142135624f : 1.0f;
    return octave * ((a * b) * (c * d));
}

// Octahedral unit vector, 16 + 16 bits (Cigolle et al. 2014); at most 0.0037 degrees off. 32,767 steps
// each way from zero, so that the axes are exact.
SHARED_FN vec3 octDirection(uint packedNormal) {  // not normalised
    const float x = float(packedNormal & 0xffffu) * (2.0f / 65534.0f) - 1.0f;
    const float y = float(packedNormal >> 16) * (2.0f / 65534.0f) - 1.0f;
    const float z = 1.0f - abs(x) - abs(y);
    const float fold = max(-z, 0.0f);
    const float fx = x >= 0.0f ? x - fold : x + fold;
    const float fy = y >= 0.0f ? y - fold : y + fold;
    return vec3(fx, fy, z);
}
SHARED_FN vec3 octDecode(uint packedNormal) {
    const vec3 d = octDirection(packedNormal);
    const float inverseLength = 1.0f / sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    return vec3(d.x * inverseLength, d.y * inverseLength, d.z * inverseLength);
}

SHARED_FN float linearFromSrgb(float s) { return s <= 0.04045f ? s / 12.92f : pow((s + 0.055f) / 1.055f, 2.4f); }
SHARED_FN float srgbFromLinear(float l) { return l <= 0.0031308f ? 12.92f * l : 1.055f * pow(l, 1.0f / 2.4f) - 0.055f; }

SHARED_END
#endif
