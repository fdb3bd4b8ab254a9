// Light on a pixel of the surface buffer, to the eye.
#include "surface.glsl"

layout(set = 0, binding = kLightsBinding, scalar) readonly buffer LightBlock { LightSource lights[]; };
layout(set = 0, binding = kTriangleWordsBinding, scalar) readonly buffer TriangleBlock { uint triangleWords[]; };  // two a pixel
layout(set = 0, binding = kEnvironmentBinding, scalar) readonly buffer EnvironmentBlock { float environment[]; };
#include "shared/environment.h"
#ifdef SHADOWED
#include "shadow.glsl"
#endif

// `colour`, and what lights of the scene's own, or the sun, send back.
vec3 withLights(vec3 colour, Surface s, vec3 point) {
    if (frame.lightCount == 0u && frame.hasEnvironment == 0u) colour += reflectLight(s, frame.sunDirection, vec3(0.75));
    for (uint k = 0u; k < frame.lightCount; ++k) {
        const LightSource light = lights[k];
        const vec3 l = light.kind == kLightDirectional ? light.position : light.position - point;
        vec3 sent = light.colour * lightAt(light, point, point.z);
#ifdef SHADOWED
        sent *= pastMaps(k, point, s.normal);
#endif
        colour += reflectLight(s, normalize(l), sent);
    }
    return colour;
}

vec3 lightOf(Surface s, vec3 point) {
    vec3 colour;
    if (frame.hasEnvironment != 0u)
        colour = frame.ambient * reflectEnvironment(s, frame.environmentX, frame.environmentY, frame.environmentZ, frame.environmentSharp);
    else
        colour = frame.ambient * reflectSky(s, frame.skyDirection);
    return withLights(colour, s, point);
}

// `colour`, `normal`: of the words.
vec3 litColour(SurfaceWords words, vec3 colour, vec3 normal, uvec2 pixel) {
    const bool isTriangle = (words.material & kPixelTriangle) != 0u;
    const float leaf = (words.material & kPixelLeaf) != 0u ? 1.0 : 0.0;
    if (isTriangle ? (words.material & kPixelUnlit) != 0u || (frame.shade & kShadeTriangles) == 0u : (frame.shade & kShadeLit) == 0u) return colour;
    // Points with a material, or under lights of the scene's own, are surfaces like any other; else theirs is one formula.
    const bool isSurface = isTriangle || (words.material & kPixelMaterial) != 0u;
    if (!isSurface && frame.lightCount == 0u && frame.hasEnvironment == 0u)
        return colour * irradiance(normal, frame.sunDirection, frame.skyDirection, leaf, float(words.material >> 16 & 255u) / 255.0);
    const PixelRay ray = pixelRayHere(pixel);
    Surface s;
    s.colour = colour;
    s.normal = normal;
    s.toEye = -normalize(rayDirection(ray));
    s.metallic = float(words.material & 255u) / 255.0;
    s.roughness = float(words.material >> 8 & 255u) / 255.0;
    s.occlusion = wordOcclusion(words.material);
    s.leaf = leaf;
    s.dielectric = vec3(kDielectric);
    vec3 lit = lightOf(s, alongRay(ray, words.depth));
    if (isTriangle) {
        const uint e = triangleWords[2u * (pixel.y * frame.width + pixel.x) + 1u];
        lit += vec3(unpackRed(e), unpackGreen(e), unpackBlue(e));
    }
    return lit;
}
