// Textured meshes for tests and demos: a boulder, a building, a terrain. Same options, same mesh.
#pragma once

#include <cstdint>
#include <string>

#include "engine/scene/scene.h"

namespace stipple::grow {

struct MeshOptions {
    std::string kind = "rock";  ///< rock, building or terrain
    uint64_t triangles = 100'000;
    uint64_t seed = 1;
    uint32_t textureSize = 1024;
};

/// About `triangles` triangles (never fewer than the shape needs), with normals, texture coordinates, base colour and
/// normal maps. Units are metres, y is up.
scene::Scene growMesh(const MeshOptions& options);

/// A texture as raw pixels, before it is encoded: sRGB colour, or a tangent-space normal map.
struct Pixels {
    uint32_t size = 0;
    std::vector<uint32_t> rgba;
};
struct Textures {
    Pixels colour, normal;
};
Textures growTextures(const MeshOptions& options);

}  // namespace stipple::grow
