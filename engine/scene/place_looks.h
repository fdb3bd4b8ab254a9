// Colours and normals of the places of a scene's triangles, from materials and textures.
#pragma once

#include "engine/scene/texture_lookup.h"
#include "lod/primitives/place_look.h"

namespace stipple::scene {

/// Of meshes as triangleSource gives them. Emission is added to the colour, alpha is left out. Both arguments must
/// stay.
lod::PlaceLooks placeLooks(const Scene& scene, const std::vector<DecodedImage>& images);

/// Some material has a texture that a PlaceLook holds something of.
bool hasTextures(const Scene& scene);

}  // namespace stipple::scene
