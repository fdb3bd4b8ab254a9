// Shading of one pixel: unlit, or one sun and a sky gradient. Linear light, exposure 1, no tone curve.
#ifndef STIPPLE_SHARED_SHADE_H
#define STIPPLE_SHARED_SHADE_H
#include "frame.h"
#include "splat.h"
SHARED_BEGIN

// Leaves let light through: what falls on the far side comes out on this one, less this share that stays inside. (In
// the visible, leaves send about as much through as back.)
const float kLeafGlow = 0.6f;

// What a leaf of a colour lets through, a byte a channel; the highest byte says that it is one.
SHARED_FN uint throughLeaf(vec3 colour) {
    return uint(int(min(max(0.0f, colour.x * kLeafGlow), 1.0f) * 255.0f + 0.5f)) |
           uint(int(min(max(0.0f, colour.y * kLeafGlow), 1.0f) * 255.0f + 0.5f)) << 8 |
           uint(int(min(max(0.0f, colour.z * kLeafGlow), 1.0f) * 255.0f + 0.5f)) << 16 | 0xff000000u;
}

// Light that a white surface with the eye-facing normal n sends to the eye; of the sky's `occlusion` gets there.
SHARED_FN float irradiance(vec3 n, vec3 sunDirection, vec3 skyDirection, float leaf, float occlusion) {
    const float towards = dot(n, sunDirection);
    const float above = 0.15f * dot(n, skyDirection);
    const float open = 0.75f * (max(towards, 0.0f) + leaf * kLeafGlow * max(-towards, 0.0f)) + 0.25f + above;
    return open - (1.0f - occlusion) * (0.25f + above);
}

// Metallic-roughness surface (glTF 2.0, appendix B): GGX with Smith's shadowing (Heitz 2014) and Schlick's Fresnel.
struct Surface {
    vec3 colour;  // base colour, linear
    vec3 normal;  // camera space, towards the eye
    vec3 toEye;
    float metallic;
    float roughness;
    float occlusion;
    float leaf;       // 1: lets light through
    vec3 dielectric;  // what it reflects straight on where it is no metal; most: kDielectric
};
const float kDielectric = 0.04f;

SHARED_FN vec3 straightOn(Surface s) {
    return vec3(s.dielectric.x + (s.colour.x - s.dielectric.x) * s.metallic,
                s.dielectric.y + (s.colour.y - s.dielectric.y) * s.metallic,
                s.dielectric.z + (s.colour.z - s.dielectric.z) * s.metallic);
}

// Light that comes back from one direction `l`, times what a white diffuse surface would send there.
SHARED_FN vec3 reflectLight(Surface s, vec3 l, vec3 light) {
    const float towards = dot(s.normal, l);
    const float nl = max(towards, 0.0f);
    const float nv = max(dot(s.normal, s.toEye), 1.0e-3f);
    vec3 h = vec3(l.x + s.toEye.x, l.y + s.toEye.y, l.z + s.toEye.z);
    const float inverse = 1.0f / sqrt(max(dot(h, h), 1.0e-12f));
    h = vec3(h.x * inverse, h.y * inverse, h.z * inverse);
    const float nh = max(dot(s.normal, h), 0.0f);
    const float vh = max(dot(s.toEye, h), 0.0f);
    const float a = max(s.roughness * s.roughness, 2.0e-3f);
    const float a2 = a * a;
    const float d = nh * nh * (a2 - 1.0f) + 1.0f;
    const float shadow = nl * sqrt(nv * nv * (1.0f - a2) + a2) + nv * sqrt(nl * nl * (1.0f - a2) + a2);
    // D * V * pi: the light's colour has the 1 / pi of the diffuse term in it.
    const float specular = a2 / (d * d) * (0.5f / max(shadow, 1.0e-6f));
    const float k = 1.0f - vh;
    const float k5 = k * k * k * k * k;
    const float diffuse = 1.0f - s.metallic;
    const vec3 f0 = straightOn(s);
    const vec3 f = vec3(f0.x + (1.0f - f0.x) * k5, f0.y + (1.0f - f0.y) * k5, f0.z + (1.0f - f0.z) * k5);
    const float through = s.leaf * kLeafGlow * diffuse * max(-towards, 0.0f);
    return vec3(light.x * (nl * (s.colour.x * diffuse * (1.0f - f.x) + f.x * specular) + through * s.colour.x),
                light.y * (nl * (s.colour.y * diffuse * (1.0f - f.y) + f.y * specular) + through * s.colour.y),
                light.z * (nl * (s.colour.z * diffuse * (1.0f - f.z) + f.z * specular) + through * s.colour.z));
}

// The sky's light: 0.25 of white from the side, more from above.
SHARED_FN float skyLight(vec3 d, vec3 up) { return 0.25f + 0.15f * dot(d, up); }

// 2^x for -10 <= x <= 0, to 2e-6 of its value: of multiplications alone, so that loops over it become SIMD. (A series
// of the 16th root around e^-0.2, and four squares.)
SHARED_FN float exp2Below(float x) {
    const float d = x * 0.0433216988f + 0.2f;
    const float root =
        0.818730753f * (1.0f + d * (1.0f + d * (0.5f + d * (0.166666667f + d * (0.0416666667f + d * 0.00833333333f)))));
    const float two = root * root;
    const float four = two * two;
    const float eight = four * four;
    return eight * eight;
}

// Where a mirror looks: the eye's direction turned about the normal; `nv`: the cosine between both, above 0.
SHARED_FN vec3 mirrorDirection(vec3 n, vec3 toEye, float nv) {
    return vec3(2.0f * nv * n.x - toEye.x, 2.0f * nv * n.y - toEye.y, 2.0f * nv * n.z - toEye.z);
}

// What a surface sends back of the light that a mirror of its roughness sees (Karis 2013, with Lazarov's fit).
SHARED_FN vec3 mirrorShare(Surface s, float nv) {
    const float rx = 1.0f - s.roughness;
    const float ry = 0.0425f - 0.0275f * s.roughness;
    const float a004 = min(rx * rx, exp2Below(-9.28f * nv)) * rx + ry;
    const float scale = -1.04f * a004 + 1.04f - 0.572f * s.roughness;
    const float bias = 1.04f * a004 - 0.04f + 0.022f * s.roughness;
    const vec3 f0 = straightOn(s);
    return vec3(f0.x * scale + bias, f0.y * scale + bias, f0.z * scale + bias);
}

// What light from all around sends back: `around` falls on the surface, `mirror` is what a mirror of its roughness
// sees.
SHARED_FN vec3 reflectAround(Surface s, float nv, vec3 around, vec3 mirror) {
    const float diffuse = 1.0f - s.metallic;
    const vec3 share = mirrorShare(s, nv);
    return vec3(s.occlusion * (s.colour.x * diffuse * around.x + share.x * mirror.x),
                s.occlusion * (s.colour.y * diffuse * around.y + share.y * mirror.y),
                s.occlusion * (s.colour.z * diffuse * around.z + share.z * mirror.z));
}

// What a mirror of the surface's roughness, which looks along r, sees of the sky.
SHARED_FN float skyMirror(Surface s, vec3 r, vec3 up) {
    return 0.25f + 0.15f * (1.0f - s.roughness) * dot(r, up) + 0.15f * s.roughness * dot(s.normal, up);
}

SHARED_FN vec3 reflectSky(Surface s, vec3 up) {
    const float nv = max(dot(s.normal, s.toEye), 1.0e-3f);
    const float mirror = skyMirror(s, mirrorDirection(s.normal, s.toEye, nv), up);
    const float around = skyLight(s.normal, up);
    return reflectAround(s, nv, vec3(around, around, around), vec3(mirror, mirror, mirror));
}

// Direction to a light from a point, and its share of what the light sends at distance 1.
SHARED_FN float lightAt(LightSource light, vec3 point, float depth) {
    const vec3 d = vec3(light.position.x - point.x, light.position.y - point.y, light.position.z - point.z);
    const float d2 = max(dot(d, d), 1.0e-12f);
    const float inverse = 1.0f / sqrt(d2);
    // (Conditions on what is the same for all pixels, only between numbers: GCC makes no SIMD of others.)
    const float reach = d2 / (light.range > 0.0f ? light.range * light.range : 3.0e38f);
    const float edge = max(1.0f - reach * reach, 0.0f);
    const float along = -dot(d, light.axis) * inverse;
    const float cone = min(max((along - light.cosOuter) / max(light.cosInner - light.cosOuter, 1.0e-4f), 0.0f), 1.0f);
    const float spread = max(cone * cone, light.kind == kLightSpot ? 0.0f : 1.0f);
    const float isEven = (light.kind == kLightDirectional ? 1.0f : 0.0f) + (depth <= 0.0f ? 1.0f : 0.0f);
    return isEven > 0.5f ? 1.0f : spread * edge * edge / d2;
}

// Colours of the debug views, linear.
SHARED_FN vec3 debugRamp(float t) {
    const float x = min(max(t, 0.0f), 1.0f);
    return vec3(min(max(1.5f - abs(4.0f * x - 3.0f), 0.0f), 1.0f), min(max(1.5f - abs(4.0f * x - 2.0f), 0.0f), 1.0f),
                min(max(1.5f - abs(4.0f * x - 1.0f), 0.0f), 1.0f));
}
// Screen-space error: 1/8 px blue, 1 px green to yellow, 8 px red.
SHARED_FN vec3 debugErrorColour(float errorPixels) {
    return debugRamp((log2(max(errorPixels, 1.0e-6f)) + 3.0f) / 6.0f);
}
SHARED_FN vec3 debugLevelColour(uint level) { return debugRamp(float(level % 8u) / 7.0f); }

// Where a pixel's colour comes from: grey its own point, blue a nearer surface that replaced its point, orange filled.
SHARED_FN vec3 debugHoleColour(float ownDepth, float depth) {
    const bool own = ownDepth > 0.0f;
    const bool replaced = own && depth != ownDepth;
    return own ? (replaced ? vec3(0.02f, 0.1f, 0.9f) : vec3(0.2f, 0.2f, 0.2f)) : vec3(1.0f, 0.3f, 0.02f);
}

SHARED_END
#endif
