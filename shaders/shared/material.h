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
};

SHARED_END
#endif
