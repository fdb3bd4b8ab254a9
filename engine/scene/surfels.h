// Meshes as surfels: evenly spread samples of the triangles, with interpolated normals and prefiltered colours.
#pragma once

#include <functional>
#include <memory>

#include "engine/scene/scene.h"
#include "engine/scene/texture_lookup.h"
#include "lod/primitives/primitives.h"

namespace stipple::scene {

struct SurfelSettings {
    uint64_t count = 2'000'000;  ///< aimed at, over all visible meshes; 0: only points that are there
};

/// Samples all visible meshes of a scene, instances included; points of point primitives are taken as they are.
/// Without surfels, open borders of triangles beside those points give points too, so that both join (borders.h).
/// `images` are those of the scene, decoded; an empty one counts as white. Errors if there is nothing to sample.
Result<lod::PointSource> sampleSurfels(const Scene& scene, const std::vector<DecodedImage>& images,
                                       const SurfelSettings& settings);

}  // namespace stipple::scene
