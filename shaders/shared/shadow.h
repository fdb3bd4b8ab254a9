// Shadows: a map of a light holds the depth of what the light meets first, a texel at a time. A place of a surface lies
// in the shadow of a texel where its plane is farther away there than what the map holds, by more than both may be off.
//
// The plane is followed to the texel's centre, so that slopes need no room of their own; what is left is stated: how
// far surfaces and casters are from what they stand for, and rounding. Four texels about a place are weighed as in
// percentage-closer filtering (Reeves, Salesin and Cook 1987); of lights that have a size sixteen places within the
// penumbra, which is as wide as what casts it is far away (Fernando 2005). Each pixel of a pattern of 4 x 4 has its
// places turned by another angle: sixteen of the same ones would show as steps.
//
// What looks into the maps is in shadow_taps.h.
#ifndef STIPPLE_SHARED_SHADOW_H
#define STIPPLE_SHARED_SHADOW_H
#include "frame.h"
#include "occlusion.h"
SHARED_BEGIN

const uint kMostShadowLights = 4u;
const uint kMostShadowMaps = 32u;

// A map in camera space: what is at p is at (right.p, down.p, forward.p) + origin before the light.
struct ShadowMap {
    vec3 right;
    vec3 down;
    vec3 forward;
    vec3 origin;         // world units; depths count from where the map's do
    float focal;         // texels per world unit; in perspective per unit of x / depth
    float reach2;        // up to so far from the eye it is used, squared
    float casterError;   // world units; in perspective over the depth
    float surfaceError;  // of what is seen, world units; where that is in perspective over its depth
    float depthStep;     // rounding of depths, world units
    float nearest;       // depth of the nearest caster
    float size;          // directional: tangent of the light's angular radius; spot: its radius; 0: borders are hard
    uint edge;           // texels
    uint stride;         // texels from one row to the next (shadowStride)
    uint first;          // of its texels among those of all maps
    uint slot;           // of the light's mask
    uint isPerspective;
    uint hasLeaves;  // some texels let light through
};

const float kLeastShadowFacing = 0.2f;         // below it errors are not stated
const float kSteepestShadowPlane = 16.0f;      // planes are followed no farther, over their distance
const float kShadowRounding = 4.76837158e-7f;  // of places in camera space, over their distance: 2^-21
const float kMostPenumbra = 0.0625f;           // radius, over the map's edge
const uint kShadowTaps = 16u;
const uint kAllLight = 0x3fffffffu;

// Of a map: rows of a power of two would lie in the same few lines of a cache.
SHARED_FN uint shadowStride(uint edge) { return edge + 16u; }

// A place of a surface as a map sees it.
struct ShadowPlace {
    float x;  // texels
    float y;
    float depth;   // less what it may be off
    float slopeX;  // of its plane, a texel
    float slopeY;
    float whole;  // its depth
};

// `normal`: of the surface, any side; `w`: lensDepth of the place in the frame's view. All in camera space.
SHARED_FN ShadowPlace shadowPlace(ShadowMap m, bool isPerspective, vec3 point, vec3 normal, float w) {
    const float px = dot(m.right, point) + m.origin.x;
    const float py = dot(m.down, point) + m.origin.y;
    const float pz = dot(m.forward, point) + m.origin.z;
    const float nx = dot(m.right, normal);
    const float ny = dot(m.down, normal);
    const float nz = dot(m.forward, normal);
    // (The light's ray is (u, v, 1), of parallel rays (0, 0, 1).)
    const float z = isPerspective ? max(pz, 1.0e-20f) : 1.0f;
    const float u = isPerspective ? px / z : 0.0f;
    const float v = isPerspective ? py / z : 0.0f;
    const float along = isPerspective ? sqrt(u * u + v * v + 1.0f) : 1.0f;
    const float across = nx * u + ny * v + nz;
    const float least = along / kSteepestShadowPlane;
    const float slope = abs(across) < least ? (across < 0.0f ? -least : least) : across;
    const float perTexel = -z / (slope * m.focal);
    const float facing = max(abs(across) / along, kLeastShadowFacing);
    const float casterError = m.casterError * (isPerspective ? z : 1.0f);
    const float rounding = m.depthStep + kShadowRounding * (abs(point.x) + abs(point.y) + abs(point.z));
    const float bias = (casterError + m.surfaceError * w) / facing + rounding;
    ShadowPlace p;
    p.x = (isPerspective ? u : px) * m.focal + 0.5f * float(int(m.edge));
    p.y = (isPerspective ? v : py) * m.focal + 0.5f * float(int(m.edge));
    p.depth = pz - bias;
    p.slopeX = nx * perTexel;
    p.slopeY = ny * perTexel;
    p.whole = pz;
    return p;
}

// Does the map hold the place?
SHARED_FN bool isOnShadowMap(ShadowMap m, ShadowPlace p) {
    const float edge = float(int(m.edge));
    return p.x >= 0.0f && p.x < edge && p.y >= 0.0f && p.y < edge && (m.isPerspective == 0u || p.whole > 0.0f);
}

// Depth of the place's plane at the centre of a texel.
SHARED_FN float shadowLimit(ShadowPlace p, float column, float row) {
    return p.depth + p.slopeX * (column + 0.5f - p.x) + p.slopeY * (row + 0.5f - p.y);
}

// The four texels about a place, and the share of the second ones.
struct ShadowTexels {
    uint at00;
    uint at10;
    uint at01;
    uint at11;
    float column;
    float row;
    float across;
    float along;
};
SHARED_FN ShadowTexels shadowTexels(ShadowMap m, float x, float y) {
    const float last = float(int(m.edge)) - 1.0f;
    const float left = min(max(0.0f, x - 0.5f), last);
    const float top = min(max(0.0f, y - 0.5f), last);
    ShadowTexels t;
    t.column = min(floor(left), last - 1.0f);
    t.row = min(floor(top), last - 1.0f);
    t.across = left - t.column;
    t.along = top - t.row;
    t.at00 = m.first + uint(int(t.row)) * m.stride + uint(int(t.column));
    t.at10 = t.at00 + 1u;
    t.at01 = t.at00 + m.stride;
    t.at11 = t.at01 + 1u;
    return t;
}
// Weighed by their shares.
SHARED_FN float ofTexels(ShadowTexels t, float v00, float v10, float v01, float v11) {
    const float upper = v00 + t.across * (v10 - v00);
    const float lower = v01 + t.across * (v11 - v01);
    return upper + t.along * (lower - upper);
}

// Places of sixteen that fill a disc evenly: on a spiral whose turns are golden angles (Vogel 1979). Direction of the
// first one at a pixel, of sixteen that are about a sixteenth of a turn apart; `seed`: of a frame of a series that is
// averaged (FrameConstants), which turns them a little further.
SHARED_FN vec2 firstGolden(uint x, uint y, uint seed) {
    const uint number = aoNumber(x & 3u, y & 3u);
    const float part = float(int(seed * 2654435769u >> 24)) * (1.0f / 256.0f);
    const float down = (float(int(number >> 2)) + part) * 0.25f;
    const float aside = 1.0f - down;
    const float inverse = 1.0f / sqrt(aside * aside + down * down);
    const float u = aside * inverse;
    const float v = down * inverse;
    const float sign = (number & 2u) == 0u ? 1.0f : -1.0f;
    return (number & 1u) == 0u ? vec2(sign * u, sign * v) : vec2(-sign * v, sign * u);
}
// Of the next one.
SHARED_FN vec2 turnedGolden(vec2 before) {
    return vec2(-0.737368878f * before.x - 0.675490294f * before.y, 0.675490294f * before.x - 0.737368878f * before.y);
}

// A mask's pixel: what of a light comes to it, ten bits a channel.
SHARED_FN uint packLight(vec3 c) {
    return uint(int(c.x * 1023.0f + 0.5f)) | uint(int(c.y * 1023.0f + 0.5f)) << 10 |
           uint(int(c.z * 1023.0f + 0.5f)) << 20;
}
SHARED_FN float lightChannel(uint word, uint shift) { return float(int(word >> shift & 1023u)) * (1.0f / 1023.0f); }
SHARED_FN vec3 unpackLight(uint word) {
    return vec3(lightChannel(word, 0u), lightChannel(word, 10u), lightChannel(word, 20u));
}

SHARED_END
#endif
