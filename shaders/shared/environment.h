// An environment as two tables: irradiance in nine spherical harmonics, and what mirrors of five roughnesses see, as
// octahedral maps (y up); where something is smoother than roughness 1/4, four sharper maps behind them. Built by
// engine/render/environment.cpp from an HDR picture.
//
// The including shader declares the floats as `environment`; C++ passes them (SHARED_TABLE, types.h).
#ifndef STIPPLE_SHARED_ENVIRONMENT_H
#define STIPPLE_SHARED_ENVIRONMENT_H
#include "shade.h"
SHARED_BEGIN

const uint kEnvironmentEdge = 128u;
const uint kEnvironmentLevels = 5u;  // roughness 0, 1/4, 1/2, 3/4, 1
const uint kEnvironmentHarmonics = 27u;
const uint kEnvironmentSharp = 4u;  // maps beyond the floats below, where there are any
const uint kEnvironmentFloats = kEnvironmentHarmonics + kEnvironmentLevels * kEnvironmentEdge * kEnvironmentEdge * 3u;

SHARED_FN vec3 environmentEntry(SHARED_TABLE uint at) {
    return vec3(environment[at], environment[at + 1u], environment[at + 2u]);
}
SHARED_FN vec3 addScaled(vec3 a, vec3 b, float s) { return vec3(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s); }

// What a white diffuse surface with the world-space normal n sends back (Ramamoorthi and Hanrahan 2001; the cosine and
// the basis' constants are in the table).
SHARED_FN vec3 environmentDiffuse(SHARED_TABLE vec3 n) {
    vec3 e = environmentEntry(SHARED_TABLE_USE 0u);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 3u), n.y);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 6u), n.z);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 9u), n.x);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 12u), n.x * n.y);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 15u), n.y * n.z);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 18u), 3.0f * n.z * n.z - 1.0f);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 21u), n.x * n.z);
    e = addScaled(e, environmentEntry(SHARED_TABLE_USE 24u), n.x * n.x - n.y * n.y);
    return vec3(max(e.x, 0.0f), max(e.y, 0.0f), max(e.z, 0.0f));
}

// Octahedral map coordinates in [0, 1] of a direction; its pole is y.
SHARED_FN vec2 environmentPlace(vec3 d) {
    const float inverse = 1.0f / (abs(d.x) + abs(d.y) + abs(d.z));
    const float x = d.x * inverse;
    const float z = d.z * inverse;
    const float fx = (1.0f - abs(z)) * (x >= 0.0f ? 1.0f : -1.0f);
    const float fz = (1.0f - abs(x)) * (z >= 0.0f ? 1.0f : -1.0f);
    return vec2(0.5f + 0.5f * (d.y >= 0.0f ? x : fx), 0.5f + 0.5f * (d.y >= 0.0f ? z : fz));
}

// Of the map of `edge` texels whose first float is number `first`.
SHARED_FN vec3 environmentMap(SHARED_TABLE vec2 place, uint first, uint edge) {
    const float last = float(edge) - 1.001f;
    const float x = min(max(0.0f, place.x * float(edge) - 0.5f), last);
    const float y = min(max(0.0f, place.y * float(edge) - 0.5f), last);
    const uint x0 = uint(int(x));
    const uint y0 = uint(int(y));
    const float fx = x - float(x0);
    const float fy = y - float(y0);
    const uint at = first + (y0 * edge + x0) * 3u;
    const uint row = edge * 3u;
    vec3 c = vec3(0.0f, 0.0f, 0.0f);
    c = addScaled(c, environmentEntry(SHARED_TABLE_USE at), (1.0f - fx) * (1.0f - fy));
    c = addScaled(c, environmentEntry(SHARED_TABLE_USE at + 3u), fx * (1.0f - fy));
    c = addScaled(c, environmentEntry(SHARED_TABLE_USE at + row), (1.0f - fx) * fy);
    return addScaled(c, environmentEntry(SHARED_TABLE_USE at + row + 3u), fx * fy);
}
SHARED_FN vec3 environmentLevel(SHARED_TABLE vec2 place, uint level) {
    return environmentMap(SHARED_TABLE_USE place,
                          kEnvironmentHarmonics + level * kEnvironmentEdge * kEnvironmentEdge * 3u, kEnvironmentEdge);
}
// The first float of sharp map `level`, of which each has half the edge of the one before.
SHARED_FN uint environmentSharp(uint edge, uint level) {
    uint first = kEnvironmentFloats;
    for (uint l = 0u; l < level; ++l) first += (edge >> l) * (edge >> l) * 3u;
    return first;
}

// What a mirror of that roughness sees in the world-space direction d. `sharp`: edge of the sharpest map; 0: the table
// has none. A surface of roughness r blurs by about 40 r^2 degrees: sharp maps stand for roughness 0, 1/16 ... 3/16.
SHARED_FN vec3 environmentMirror(SHARED_TABLE vec3 d, float roughness, uint sharp) {
    const bool isSharp = sharp > 0u && roughness < 0.25f;
    const float steps = isSharp ? 16.0f : float(kEnvironmentLevels - 1u);
    const float most = isSharp ? float(kEnvironmentSharp) : float(kEnvironmentLevels);
    const float l = min(max(0.0f, roughness), 1.0f) * steps;
    const uint level = uint(int(min(l, most - (isSharp ? 0.001f : 1.001f))));
    const float between = l - float(level);
    const vec2 place = environmentPlace(d);
    vec3 c;
    vec3 next;
    if (isSharp) {
        c = environmentMap(SHARED_TABLE_USE place, environmentSharp(sharp, level), sharp >> level);
        if (level + 1u < kEnvironmentSharp)
            next = environmentMap(SHARED_TABLE_USE place, environmentSharp(sharp, level + 1u), sharp >> (level + 1u));
        else
            next = environmentLevel(SHARED_TABLE_USE place, 1u);
    } else {
        c = environmentLevel(SHARED_TABLE_USE place, level);
        next = environmentLevel(SHARED_TABLE_USE place, level + 1u);
    }
    return vec3(c.x + between * (next.x - c.x), c.y + between * (next.y - c.y), c.z + between * (next.z - c.z));
}

// The environment's share of a surface's light; toWorld: rows of the rotation from camera space to the map's.
SHARED_FN vec3 reflectEnvironment(SHARED_TABLE Surface s, vec3 toWorldX, vec3 toWorldY, vec3 toWorldZ, uint sharp) {
    const float nv = max(dot(s.normal, s.toEye), 1.0e-3f);
    const vec3 r = mirrorDirection(s.normal, s.toEye, nv);
    const vec3 around = environmentDiffuse(
        SHARED_TABLE_USE vec3(dot(toWorldX, s.normal), dot(toWorldY, s.normal), dot(toWorldZ, s.normal)));
    const vec3 mirror = environmentMirror(SHARED_TABLE_USE vec3(dot(toWorldX, r), dot(toWorldY, r), dot(toWorldZ, r)),
                                          s.roughness, sharp);
    return reflectAround(s, nv, around, mirror);
}

SHARED_END
#endif
