// Forests and meadows on hills, and what a demo shows: plants that stand in many places, and the ground below them.
#pragma once

#include <cstdint>
#include <string>

#include "engine/scene/scene.h"

namespace stipple::grow {

struct LandscapeOptions {
    uint64_t seed = 1;
    uint64_t trees = 10'000;
    uint64_t leaves = 200'000;  ///< of a tree, about
    double spacing = 9;         ///< metres between trees, about
    uint32_t variants = 2;      ///< trees that are grown of each species
    double meadow = 60;         ///< edge of a meadow, metres
    bool asTriangles = false;   ///< of plants
};

/// Trees of all species on hills, in patches of their own, with a clearing in the middle. Each tree is one mesh,
/// instanced (EXT_mesh_gpu_instancing). Units are metres, y is up.
scene::Scene growForest(const LandscapeOptions& options);

/// Grass and flowers: a few patches of blades and stalks, instanced over a square of gentle ground.
scene::Scene growMeadow(const LandscapeOptions& options);

/// Gentle ground with a meadow, a small orchard, a boulder, balls of glass and mirrors; the file `store` (a scan)
/// stands beside them.
scene::Scene growDemo(const LandscapeOptions& options, const std::string& store);
/// A camera path through it (for --camera-path): from afar, past glass and mirrors, between the rows, to the sky.
std::string demoWalk();

}  // namespace stipple::grow
