// Maps of lights that cast shadows, and the masks made of them (shared/shadow_taps.h).
#include "surface.glsl"

layout(set = 0, binding = kShadowDepthsBinding, scalar) readonly buffer ShadowDepthBlock { float shadowDepths[]; };
layout(set = 0, binding = kShadowThroughBinding, scalar) readonly buffer ShadowThroughBlock { uint shadowThrough[]; };
#define SHARED_SHADOW
#define SHARED_SHADOW_USE
#include "shared/shadow_taps.h"
layout(set = 0, binding = kShadowMapsBinding, scalar) readonly buffer ShadowMapBlock { ShadowMap shadowMaps[]; };  // of each light the finest first

// What of a light comes to a place: from its first map that holds it.
vec3 lightOfSlot(uint slot, vec3 point, vec3 normal) {
    const float w = lensDepth(frameLensHere(), point.z);
    for (uint k = 0u; k < frame.shadowMaps; ++k) {
        const ShadowMap m = shadowMaps[k];
        if (m.slot != slot || dot(point, point) > m.reach2) continue;
        const ShadowPlace p = shadowPlace(m, m.isPerspective != 0u, point, normal, w);
        if (isOnShadowMap(m, p)) return lightPast(m, p);
    }
    return vec3(1.0);
}
