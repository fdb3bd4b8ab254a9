// Records that a device or the host makes up: hilly ground of edge 1, whose hills go on in the next tile, in any order.
// Whole numbers alone, so that both make the same bits.
#ifndef STIPPLE_SHARED_GROUND_H
#define STIPPLE_SHARED_GROUND_H
#include "record.h"
SHARED_BEGIN

const uint kGroundThreads = 256u;  // of a workgroup

// Where a tile's records lie, and what the device is to do: fill all of them, or, where `to` is an address, copy
// `count` of them there, `stride` apart.
struct GroundStep {
    uint addressLow;
    uint addressHigh;
    uint toLow;
    uint toHigh;
    uint tile;
    uint radiusCode;
    uint count;
    uint stride;
};
SHARED_FN uint groundSampled(GroundStep s, uint k) { return k * s.stride + s.tile % s.stride; }

// Hash of 32 bits: the output of a PCG (Jarzynski and Olano 2020).
SHARED_FN uint groundHash(uint v) {
    const uint s = v * 747796405u + 2891336453u;
    const uint w = ((s >> ((s >> 28) + 4u)) ^ s) * 277803737u;
    return (w >> 22) ^ w;
}
// Sine of 65536ths of a turn, in 16384ths: parabolas, and theirs on top; at most 0.2 % off.
SHARED_FN int groundSine(uint turn) {
    const int half_ = int(turn & 0x7fffu);
    const int p = (half_ * (0x8000 - half_)) >> 14;
    const int s = (p * (12698 + ((3686 * p) >> 14))) >> 14;
    return (turn & 0x8000u) == 0u ? s : -s;
}
SHARED_FN int groundProduct(int a, int b) { return (a * b) >> 14; }

// Record `index` of a tile.
SHARED_FN PointRecord groundRecord(uint tile, uint index, uint radiusCode) {
    const uint place = groundHash(groundHash(tile) + index), tint = groundHash(place + 1u);
    const uint x = place & 0xffffu, y = place >> 16;
    const int sinX = groundSine(x), cosX = groundSine(x + 0x4000u), sinY = groundSine(y),
              cosY = groundSine(y + 0x4000u);
    // Hills of 0.08, whose slope is 0.08 * 2 pi at most.
    const uint height = uint(32768 + groundProduct(5243, groundProduct(sinX, cosY)));
    const int nx = -groundProduct(8235, groundProduct(cosX, cosY)), ny = groundProduct(8235, groundProduct(sinX, sinY));
    const int sum = (nx < 0 ? -nx : nx) + (ny < 0 ? -ny : ny) + 16384;
    PointRecord r;
    r.positionXY = place;
    r.positionZRadiusError = height | radiusCode << 16;
    r.normal = uint(32767 * (sum + nx)) / uint(sum) | uint(32767 * (sum + ny)) / uint(sum) << 16;  // octahedral
    r.colour = ((tint & 0x3f3f3fu) + 0x406050u) | kFlagTwoSided << 24;
    return r;
}

SHARED_END
#endif
