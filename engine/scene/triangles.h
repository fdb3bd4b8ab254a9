// The triangles of a scene's meshes as they are built from, with the materials that their vertices name.
#pragma once

#include <span>

#include "engine/scene/scene.h"
#include "engine/scene/texture_lookup.h"
#include "lod/primitives/mesh_source.h"

namespace stipple::scene {

/// A mesh somewhere.
struct Placement {
    int mesh = -1;
    glm::dmat4 world{1};
};
/// Of all visible nodes, instances included.
std::vector<Placement> placements(const Scene& scene);

/// Triangles of `placed`, in world space; mirrored placements change the winding. Points and lines are left out. The
/// source reads `scene`, which must stay.
lod::MeshSource triangleSource(const Scene& scene, std::vector<Placement> placed);

/// Vertices have one set of coordinates: that of the first texture of the material (colour, normal, metal and
/// roughness, emission, occlusion), with its transform applied.
TextureUse leadingUse(const Material& m);
/// Is there a picture, on the same set of coordinates as the leading one?
bool isOnLeading(const Scene& scene, const TextureUse& use, const TextureUse& leading);

std::vector<shared::SurfaceMaterial> surfaceMaterials(const Scene& scene);

/// Of each of them, as `placed` has it: those of materials that none of it has are those of one that some has, so that
/// what is glass all over has nothing else. Empty where none lets light through, nor reflects more or less than most.
/// Materials that blend do so where factor, vertices or texture let something through. Textures that are cut out
/// (leaves: as good as all that is there is opaque) are not: of those the nearest would hide the others behind its
/// clear part. `images`: of the scene, decoded, or none: then what a texture has is not known, and counts as clear.
std::vector<lod::Optics> surfaceOptics(const Scene& scene, const std::vector<Placement>& placed,
                                       std::span<const DecodedImage> images = {});

/// What each texture of the scene is used for, with its wrap modes; pixels are not set.
std::vector<lod::TextureImage> textureImages(const Scene& scene);

}  // namespace stipple::scene
