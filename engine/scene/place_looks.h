// Colours, normals and materials of the places of a scene's triangles, from materials and textures.
#pragma once

#include "engine/scene/texture_lookup.h"
#include "lod/primitives/place_look.h"
#include "lod/primitives/point_material.h"

namespace stipple::scene {

/// What the triangles of a scene's visible nodes are lit by.
struct MaterialList {
    std::vector<lod::PointMaterial> list;  ///< each once; materialGrid() where textures say how rough or metallic it is
    std::vector<uint8_t> numbers;          ///< in it, of each of the scene's materials, and of "none"
    bool isGrid = false;
    /// Glass and what is none in one list.
    bool hasMixedOptics() const;
};
MaterialList materialList(const Scene& scene);

/// Of meshes as triangleSource gives them, with numbers in the list of materials. Alpha is left out. Both arguments
/// must stay.
lod::PlaceLooks placeLooks(const Scene& scene, const std::vector<DecodedImage>& images);

/// What the textures behind those looks hold, of the materials of visible triangles.
lod::TextureDetail textureDetail(const Scene& scene, const std::vector<DecodedImage>& images);

/// Some material of visible triangles sends light, or is not lit.
bool hasLight(const Scene& scene);
/// Are all of them not lit?
bool isAllUnlit(const Scene& scene);

/// Some material has a texture that a PlaceLook holds something of.
bool hasTextures(const Scene& scene);

}  // namespace stipple::scene
