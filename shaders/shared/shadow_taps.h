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

// Radius of the penumbra at a place, texels. 0: the border is hard there; less: nothing hides the light. `first`: of
// firstGolden.
SHARED_FN float penumbra(SHARED_SHADOW ShadowMap m, ShadowPlace p, vec2 first) {
    const bool isFar = m.isPerspective == 0u;
    const float most = kMostPenumbra * float(int(m.edge));
    // The light seen from the place covers so much of the map, at the depth of the nearest caster.
    const float gap = max(p.whole - m.nearest, 0.0f);
    const float search =
        min(isFar ? gap * m.size * m.focal : gap * m.size * m.focal / (p.whole * max(m.nearest, 1.0e-20f)), most);
    vec2 direction = first;
    float sum = 0.0f;
    float count = 0.0f;
    const float last = float(int(m.edge)) - 1.0f;
    for (uint k = 0u; k < kShadowTaps; ++k) {
        // (From the place itself on: what is near and narrow must not be missed.)
        const float radius = search * sqrt(float(int(k)) / float(int(kShadowTaps)));
        const float column = floor(min(max(0.0f, p.x + radius * direction.x), last));
        const float row = floor(min(max(0.0f, p.y + radius * direction.y), last));
        const float depth = shadowDepths[m.first + uint(int(row)) * m.edge + uint(int(column))];
        const bool isHidden = depth < shadowLimit(p, column, row);
        sum += isHidden ? depth : 0.0f;
        count += isHidden ? 1.0f : 0.0f;
        direction = turnedGolden(direction);
    }
    const float caster = sum / max(count, 1.0f);
    const float apart = max(p.whole - caster, 0.0f) * m.size * m.focal;
    const float radius = min(isFar ? apart : apart / (p.whole * max(caster, 1.0e-20f)), most);
    return count > 0.0f ? radius : search < 1.0f ? 0.0f : -1.0f;
}

// What of the light comes to a place. `first`: of firstGolden.
SHARED_FN vec3 lightPast(SHARED_SHADOW ShadowMap m, ShadowPlace p, vec2 first) {
    const float radius = m.size > 0.0f ? penumbra(SHARED_SHADOW_USE m, p, first) : 0.0f;
    if (radius < 0.0f) return vec3(1.0f, 1.0f, 1.0f);
    vec3 sum = vec3(0.0f, 0.0f, 0.0f);
    vec2 direction = first;
    const uint taps = radius > 0.0f ? kShadowTaps : 1u;
    for (uint k = 0u; k < taps; ++k) {
        const float off = radius * sqrt((float(int(k)) + 0.5f) / float(int(kShadowTaps)));
        const float x = p.x + off * direction.x;
        const float y = p.y + off * direction.y;
        vec3 past;
        if (m.hasLeaves != 0u) {
            past = shadowColour(SHARED_SHADOW_USE m, p, x, y);
        } else {
            const float share = shadowShare(SHARED_SHADOW_USE m, p, x, y);
            past = vec3(share, share, share);
        }
        sum = vec3(sum.x + past.x, sum.y + past.y, sum.z + past.z);
        direction = turnedGolden(direction);
    }
    const float inverse = 1.0f / float(int(taps));
    return vec3(sum.x * inverse, sum.y * inverse, sum.z * inverse);
}

SHARED_END
#endif
