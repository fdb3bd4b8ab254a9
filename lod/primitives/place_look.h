// What the materials of a mesh say of a place between its vertices: for what is made of the mesh and keeps no textures.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>

namespace stipple::lod {

struct PlaceLook {
    glm::vec3 colour{1};        ///< linear; times that of the vertices
    glm::vec3 normal{0, 0, 1};  ///< in the triangle's tangents: x along u, y against v
    uint8_t material = 0;       ///< number in a list that comes with the function
    glm::vec3 emission{0};      ///< linear, any brightness
    bool isUnlit = false;       ///< shown as it is, whatever the light
};

/// What the textures behind looks hold.
struct TextureDetail {
    /// Texels of a surface's finest texture along a unit of texture coordinates (the mean of both); 0: it has none.
    std::function<float(uint32_t surface)> texels;
    bool hasNormals = false, hasMaterials = false;  ///< textures say something of normals; of roughness or metallic
    bool hasLight = false;  ///< some material sends light, or is not lit, with textures or without: patches keep that
};

/// Maps of patches that are made of a mesh.
struct MapSettings {
    uint32_t texels = 0;   ///< along an edge of a cell: 1 (there are none), 2, 4 or 8; 0: as many as textures hold
    TextureDetail detail;  ///< without `texels`, all have none
    bool any() const { return texels != 1 && detail.texels; }
};

/// `surface`: of the triangle's vertices; `uv`: of the place; `side`: of the square that is averaged over, in texture
/// coordinates.
using PlaceLooks = std::function<PlaceLook(uint32_t surface, const glm::vec2& uv, float side)>;

}  // namespace stipple::lod
