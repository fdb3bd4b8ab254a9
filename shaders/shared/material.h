// Metallic-roughness material (glTF 2.0, 3.9) as the passes read it. Factors are linear.
#ifndef STIPPLE_SHARED_MATERIAL_H
#define STIPPLE_SHARED_MATERIAL_H
#include "types.h"
SHARED_BEGIN

// uv' = (dot(rowU, (u, v, 1)), dot(rowV, (u, v, 1))).
struct TextureSlot {
    uint texture;  // index + 1; 0: none
    vec3 rowU;
    vec3 rowV;
};

struct SurfaceMaterial {
    vec3 baseColour;
    float alphaCutoff;
    vec3 emissive;
    float metallic;
    float roughness;
    float normalScale;
    float occlusionStrength;
    float alpha;
    TextureSlot baseTexture;
    TextureSlot surfaceTexture;  // g: roughness, b: metallic
    TextureSlot normalTexture;
    TextureSlot occlusionTexture;
    TextureSlot emissiveTexture;
    uint optics;  // bits of the surface's material word (optics.h): which of the frame's; not in files
};

// The material of a point, packed: metallic 8 | roughness 8. (Its base colour is its own.)
SHARED_FN uint packPointMaterial(float roughness, float metallic) {
    return uint(int(min(max(0.0f, metallic), 1.0f) * 255.0f + 0.5f)) |
           uint(int(min(max(0.0f, roughness), 1.0f) * 255.0f + 0.5f)) << 8;
}
const uint kPlainPoint = 0x10000u;    // in its place: no material
const uint kOnlyMaterial = 0x20000u;  // of a node's: instead of those of its records

SHARED_END
#endif
