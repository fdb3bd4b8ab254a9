// Light of a pixel of a layer of glass, to the eye (shared/optics.h).
#include "light.glsl"

layout(set = 0, binding = kBehindBinding, scalar) readonly buffer BehindBlock { float behind[]; };
layout(set = 0, binding = kBackBinding, scalar) readonly buffer BackBlock { float back[]; };
#include "shared/optics.h"
layout(set = 0, binding = kLayerBinding, scalar) readonly buffer LayerBlock { LayerConstants layers[]; };
layout(set = 0, binding = kOpticsBinding, scalar) readonly buffer OpticsBlock { Optic optics[]; };

// `colour`, `normal`: of the words.
vec3 glassColour(SurfaceWords words, vec3 colour, vec3 normal, uvec2 pixel) {
    const LayerConstants layer = layers[0];
    const bool isTriangle = (words.material & kPixelTriangle) != 0u;
    const uint own = isTriangle ? (words.material & kPixelOptics) >> kPixelOpticsShift : 0u;
    const uint number = own != 0u ? own : layer.pointOptic;
    if (number == 0u) return colour;  // opaque: what is behind shows it
    const Optic o = optics[own == kPixelBlends >> kPixelOpticsShift ? 0u : number];
    const PixelRay ray = pixelRayHere(pixel);
    Surface s;
    s.colour = colour;
    s.normal = normal;
    s.toEye = -normalize(rayDirection(ray));
    s.metallic = float(words.material & 255u) / 255.0;
    s.roughness = float(words.material >> 8 & 255u) / 255.0;
    if (own == 0u && (words.material & kPixelMaterial) == 0u) s.roughness = layer.plainRoughness;
    s.occlusion = wordOcclusion(words.material);
    s.leaf = 0.0;
    s.dielectric = o.straightOn;
    const vec3 point = alongRay(ray, words.depth);
    vec3 lit = opticLight(frame, layer, o, s, point, withLights(vec3(0.0), opaqueShare(s, o), point));
    if (isTriangle) {
        const uint e = triangleWords[2u * (pixel.y * frame.width + pixel.x) + 1u];
        lit += vec3(unpackRed(e), unpackGreen(e), unpackBlue(e));
    }
    return lit;
}
