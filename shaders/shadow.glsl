// What comes of lights past their shadow maps, whose texels are read by device address (shared/shadow_taps.h).
#include "shared/shadow_table.h"

layout(set = 0, binding = kShadowBinding, scalar) uniform ShadowBlock { ShadowTable shadow; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ShadowDepths { float values[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer ShadowThrough { uint values[]; };

#define SHARED_SHADOW ShadowDepths depthsAt, ShadowThrough throughAt,
#define SHARED_SHADOW_USE depthsAt, throughAt,
#define shadowDepths depthsAt.values
#define shadowThrough throughAt.values
#include "shared/shadow_taps.h"

// What of the light comes to a place. `first`: of firstGolden.
vec3 lightPast(SHARED_SHADOW ShadowMap m, ShadowPlace p, vec2 first) {
    const bool isPerspective = m.isPerspective != 0u;
    float radius = 0.0;
    if (m.size > 0.0) {
        const float reach = casterReach(m, isPerspective, p);
        ShadowCasters c = noCasters(first);
        for (uint k = 0u; k < kShadowTaps; ++k) c = lookForCaster(SHARED_SHADOW_USE m, p, reach, k, c);
        radius = penumbraOf(m, isPerspective, p, reach, c);
    }
    if (radius < 0.0) return vec3(1.0);
    vec3 sum = vec3(0.0);
    vec2 direction = first;
    const uint taps = radius > 0.0 ? kShadowTaps : 1u;
    for (uint k = 0u; k < taps; ++k) {
        sum += lightInPenumbra(SHARED_SHADOW_USE m, m.hasLeaves != 0u, p, radius, k, direction);
        direction = turnedGolden(direction);
    }
    return sum * (1.0 / float(int(taps)));
}

// What of light `number` comes to a place: past its first map that holds the place.
vec3 pastMaps(uint number, vec3 point, vec3 normal) {
    uint slot = 0u;
    while (slot < shadow.slots && shadow.lights[slot] != number) ++slot;
    if (slot == shadow.slots) return vec3(1.0);
    const float w = lensDepth(frameLensHere(), point.z);
    const vec2 first = firstGolden(gl_GlobalInvocationID.x, gl_GlobalInvocationID.y, frame.coverageSeed);
    for (uint k = 0u; k < shadow.count; ++k) {
        ShadowMap m = shadow.maps[k];
        if (m.slot != slot || dot(point, point) > m.reach2) continue;
        const ShadowPlace p = shadowPlace(m, m.isPerspective != 0u, point, normal, w);
        if (!isOnShadowMap(m, p)) continue;
        const ShadowTexelsAt at = shadow.texels[k];
        return lightPast(ShadowDepths(uvec2(at.depthsLow, at.depthsHigh)), ShadowThrough(uvec2(at.throughLow, at.throughHigh)), m, p, first);
    }
    return vec3(1.0);
}
