// What comes of a light past its map (shadow.h): lookups of the map's texels. The including file says how they are
// reached: in GLSL the depths are declared as `shadowDepths` and what leaves let through as `shadowThrough`, and
// SHARED_SHADOW and SHARED_SHADOW_USE are empty; in C++ they are parameters of those names, and arguments.
#ifndef STIPPLE_SHARED_SHADOW_TAPS_H
#define STIPPLE_SHARED_SHADOW_TAPS_H
#include "shadow.h"
SHARED_BEGIN

// How much of the light of four texels' centres comes past opaque casters. (x, y): the place's, or one beside it.
SHARED_FN float shadowShare(SHARED_SHADOW ShadowMap m, ShadowPlace p, float x, float y) {
    const ShadowTexels t = shadowTexels(m, x, y);
    const float v00 = shadowDepths[t.at00] < shadowLimit(p, t.column, t.row) ? 0.0f : 1.0f;
    const float v10 = shadowDepths[t.at10] < shadowLimit(p, t.column + 1.0f, t.row) ? 0.0f : 1.0f;
    const float v01 = shadowDepths[t.at01] < shadowLimit(p, t.column, t.row + 1.0f) ? 0.0f : 1.0f;
    const float v11 = shadowDepths[t.at11] < shadowLimit(p, t.column + 1.0f, t.row + 1.0f) ? 0.0f : 1.0f;
    return ofTexels(t, v00, v10, v01, v11);
}

SHARED_FN float byteOf(uint word, uint shift) { return float(int(word >> shift & 255u)) * (1.0f / 255.0f); }
// What a texel lets through to a place.
SHARED_FN vec3 shadowTexel(SHARED_SHADOW uint at, float limit) {
    const uint through = shadowThrough[at];
    const bool isHidden = shadowDepths[at] < limit;
    return vec3(isHidden ? byteOf(through, 0u) : 1.0f, isHidden ? byteOf(through, 8u) : 1.0f,
                isHidden ? byteOf(through, 16u) : 1.0f);
}
// As shadowShare, where leaves let light through.
SHARED_FN vec3 shadowColour(SHARED_SHADOW ShadowMap m, ShadowPlace p, float x, float y) {
    const ShadowTexels t = shadowTexels(m, x, y);
    const vec3 v00 = shadowTexel(SHARED_SHADOW_USE t.at00, shadowLimit(p, t.column, t.row));
    const vec3 v10 = shadowTexel(SHARED_SHADOW_USE t.at10, shadowLimit(p, t.column + 1.0f, t.row));
    const vec3 v01 = shadowTexel(SHARED_SHADOW_USE t.at01, shadowLimit(p, t.column, t.row + 1.0f));
    const vec3 v11 = shadowTexel(SHARED_SHADOW_USE t.at11, shadowLimit(p, t.column + 1.0f, t.row + 1.0f));
    return vec3(ofTexels(t, v00.x, v10.x, v01.x, v11.x), ofTexels(t, v00.y, v10.y, v01.y, v11.y),
                ofTexels(t, v00.z, v10.z, v01.z, v11.z));
}

// What casts about a place: looked for at sixteen others, one after another.
struct ShadowCasters {
    vec2 direction;  // in which the next one lies
    float sum;       // of the depths of those that were met ...
    float count;     // ... so many
};
SHARED_FN ShadowCasters noCasters(vec2 first) {
    ShadowCasters c;
    c.direction = first;
    c.sum = 0.0f;
    c.count = 0.0f;
    return c;
}
// How far about the place, texels: the light seen from it covers so much of the map, at the depth of the nearest
// caster.
SHARED_FN float casterReach(ShadowMap m, bool isPerspective, ShadowPlace p) {
    const float gap = max(p.whole - m.nearest, 0.0f) * m.size * m.focal;
    return min(isPerspective ? gap / (p.whole * max(m.nearest, 1.0e-20f)) : gap, kMostPenumbra * float(int(m.edge)));
}
// Place number k. (From the place itself on: what is near and narrow must not be missed.)
SHARED_FN ShadowCasters lookForCaster(SHARED_SHADOW ShadowMap m, ShadowPlace p, float reach, uint k, ShadowCasters c) {
    const float last = float(int(m.edge)) - 1.0f;
    const float radius = reach * sqrt(float(int(k)) / float(int(kShadowTaps)));
    const float column = floor(min(max(0.0f, p.x + radius * c.direction.x), last));
    const float row = floor(min(max(0.0f, p.y + radius * c.direction.y), last));
    const float depth = shadowDepths[m.first + uint(int(row)) * m.edge + uint(int(column))];
    const bool isHidden = depth < shadowLimit(p, column, row);
    ShadowCasters next;
    next.direction = turnedGolden(c.direction);
    next.sum = c.sum + (isHidden ? depth : 0.0f);
    next.count = c.count + (isHidden ? 1.0f : 0.0f);
    return next;
}
// Radius of the penumbra, texels, after all of them. 0: the border is hard there; less: nothing hides the light.
SHARED_FN float penumbraOf(ShadowMap m, bool isPerspective, ShadowPlace p, float reach, ShadowCasters c) {
    const float caster = c.sum / max(c.count, 1.0f);
    const float apart = max(p.whole - caster, 0.0f) * m.size * m.focal;
    const float radius =
        min(isPerspective ? apart / (p.whole * max(caster, 1.0e-20f)) : apart, kMostPenumbra * float(int(m.edge)));
    return c.count > 0.0f ? radius : reach < 1.0f ? 0.0f : -1.0f;
}

// What comes past at place number k of a penumbra, which lies in that direction.
SHARED_FN vec3 lightInPenumbra(SHARED_SHADOW ShadowMap m, bool hasLeaves, ShadowPlace p, float radius, uint k,
                               vec2 direction) {
    const float off = radius * sqrt((float(int(k)) + 0.5f) / float(int(kShadowTaps)));
    const float x = p.x + off * direction.x;
    const float y = p.y + off * direction.y;
    if (hasLeaves) return shadowColour(SHARED_SHADOW_USE m, p, x, y);
    const float share = shadowShare(SHARED_SHADOW_USE m, p, x, y);
    return vec3(share, share, share);
}

SHARED_END
#endif
