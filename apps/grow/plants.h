// Trees as tubes and ribbons, or as the triangles that stand for the same. Same options, same tree.
#pragma once

#include <cstdint>
#include <string>

#include "engine/scene/scene.h"

namespace stipple::grow {

struct PlantOptions {
    std::string species = "oak";  ///< oak, birch or spruce
    uint64_t leaves = 50'000;     ///< about that many
    uint64_t seed = 1;
    bool asTriangles = false;  ///< prisms and strips instead of lines with radii and normals
    uint32_t rows = 1;         ///< rows x rows instances of the tree, in a square
};

/// Two primitives: wood (material 0 of plantMaterials) and leaves (1). Units are metres, y is up.
scene::Mesh growPlantMesh(const PlantOptions& options);
std::vector<scene::Material> plantMaterials();

/// One such mesh and a node that places it.
scene::Scene growPlant(const PlantOptions& options);

}  // namespace stipple::grow
