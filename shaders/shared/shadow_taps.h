// What comes of a light past its map (shadow.h): lookups of the map's texels. The including file says how they are
// reached: in GLSL the depths are declared as `shadowDepths` and what leaves let through as `shadowThrough`, and
// SHARED_SHADOW and SHARED_SHADOW_USE are empty; in C++ they are parameters of those names, and arguments.
#ifndef STIPPLE_SHARED_SHADOW_TAPS_H
#define STIPPLE_SHARED_SHADOW_TAPS_H
#include "shadow.h"
SHARED_BEGIN

// How much of the light of four texels' centres comes past opaque casters, of their depths.
SHARED_FN float shareOfFour(ShadowPlace p, ShadowTexels t, float d00, float d10, float d01, float d11) {
    const float v00 = d00 < shadowLimit(p, t.column, t.row) ? 0.0f : 1.0f;
    const float v10 = d10 < shadowLimit(p, t.column + 1.0f, t.row) ? 0.0f : 1.0f;
    const float v01 = d01 < shadowLimit(p, t.column, t.row + 1.0f) ? 0.0f : 1.0f;
    const float v11 = d11 < shadowLimit(p, t.column + 1.0f, t.row + 1.0f) ? 0.0f : 1.0f;
    return ofTexels(t, v00, v10, v01, v11);
}
// (x, y): the place's, or one beside it.
SHARED_FN float shadowShare(SHARED_SHADOW ShadowMap m, ShadowPlace p, float x, float y) {
    const ShadowTexels t = shadowTexels(m, x, y);
    return shareOfFour(p, t, shadowDepths[t.at00], shadowDepths[t.at10], shadowDepths[t.at01], shadowDepths[t.at11]);
}

SHARED_FN float byteOf(uint word, uint shift) { return float(int(word >> shift & 255u)) * (1.0f / 255.0f); }
// What a texel lets through to a place; `limit`: of the place there.
SHARED_FN vec3 shadowTexel(float depth, uint through, float limit) {
    const bool isHidden = depth < limit;
    return vec3(isHidden ? byteOf(through, 0u) : 1.0f, isHidden ? byteOf(through, 8u) : 1.0f,
                isHidden ? byteOf(through, 16u) : 1.0f);
}
// As shareOfFour, where leaves let light through.
SHARED_FN vec3 colourOfFour(ShadowPlace p, ShadowTexels t, float d00, float d10, float d01, float d11, uint through00,
                            uint through10, uint through01, uint through11) {
    const vec3 v00 = shadowTexel(d00, through00, shadowLimit(p, t.column, t.row));
    const vec3 v10 = shadowTexel(d10, through10, shadowLimit(p, t.column + 1.0f, t.row));
    const vec3 v01 = shadowTexel(d01, through01, shadowLimit(p, t.column, t.row + 1.0f));
    const vec3 v11 = shadowTexel(d11, through11, shadowLimit(p, t.column + 1.0f, t.row + 1.0f));
    return vec3(ofTexels(t, v00.x, v10.x, v01.x, v11.x), ofTexels(t, v00.y, v10.y, v01.y, v11.y),
                ofTexels(t, v00.z, v10.z, v01.z, v11.z));
}
SHARED_FN vec3 shadowColour(SHARED_SHADOW ShadowMap m, ShadowPlace p, float x, float y) {
    const ShadowTexels t = shadowTexels(m, x, y);
    return colourOfFour(p, t, shadowDepths[t.at00], shadowDepths[t.at10], shadowDepths[t.at01], shadowDepths[t.at11],
                        shadowThrough[t.at00], shadowThrough[t.at10], shadowThrough[t.at01], shadowThrough[t.at11]);
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
// The texel at place number k. (From the place itself on: what is near and narrow must not be missed.)
struct CasterTexel {
    float column;
    float row;
    uint at;
};
SHARED_FN CasterTexel casterTexel(ShadowMap m, ShadowPlace p, float reach, uint k, vec2 direction) {
    const float last = float(int(m.edge)) - 1.0f;
    const float radius = reach * sqrt(float(int(k)) / float(int(kShadowTaps)));
    CasterTexel t;
    t.column = floor(min(max(0.0f, p.x + radius * direction.x), last));
    t.row = floor(min(max(0.0f, p.y + radius * direction.y), last));
    t.at = m.first + uint(int(t.row)) * m.stride + uint(int(t.column));
    return t;
}
// With the one whose depth it is.
SHARED_FN ShadowCasters withCaster(ShadowPlace p, CasterTexel t, float depth, ShadowCasters c) {
    const bool isHidden = depth < shadowLimit(p, t.column, t.row);
    ShadowCasters next;
    next.direction = turnedGolden(c.direction);
    next.sum = c.sum + (isHidden ? depth : 0.0f);
    next.count = c.count + (isHidden ? 1.0f : 0.0f);
    return next;
}
SHARED_FN ShadowCasters lookForCaster(SHARED_SHADOW ShadowMap m, ShadowPlace p, float reach, uint k, ShadowCasters c) {
    const CasterTexel t = casterTexel(m, p, reach, k, c.direction);
    return withCaster(p, t, shadowDepths[t.at], c);
}
// Radius of the penumbra, texels, after all of them. 0: the border is hard there; less: nothing hides the light.
SHARED_FN float penumbraOf(ShadowMap m, bool isPerspective, ShadowPlace p, float reach, ShadowCasters c) {
    const float caster = c.sum / max(c.count, 1.0f);
    const float apart = max(p.whole - caster, 0.0f) * m.size * m.focal;
    const float radius =
        min(isPerspective ? apart / (p.whole * max(caster, 1.0e-20f)) : apart, kMostPenumbra * float(int(m.edge)));
    return c.count > 0.0f ? radius : reach < 1.0f ? 0.0f : -1.0f;
}

// Place number k of a penumbra, which lies in that direction.
SHARED_FN vec2 penumbraPlace(ShadowPlace p, float radius, uint k, vec2 direction) {
    const float off = radius * sqrt((float(int(k)) + 0.5f) / float(int(kShadowTaps)));
    return vec2(p.x + off * direction.x, p.y + off * direction.y);
}
// What comes past there.
SHARED_FN vec3 lightInPenumbra(SHARED_SHADOW ShadowMap m, bool hasLeaves, ShadowPlace p, float radius, uint k,
                               vec2 direction) {
    const vec2 at = penumbraPlace(p, radius, k, direction);
    if (hasLeaves) return shadowColour(SHARED_SHADOW_USE m, p, at.x, at.y);
    const float share = shadowShare(SHARED_SHADOW_USE m, p, at.x, at.y);
    return vec3(share, share, share);
}

SHARED_END
#endif
