// What is known of a scene beside its stores: lights, cameras, one description for all, what a camera must see.
#pragma once

#include <optional>
#include <vector>

#include "engine/render/frame.h"
#include "engine/scene/camera.h"
#include "engine/scene/scene.h"
#include "lod/primitives/point_material.h"

namespace stipple::scene {

/// Of visible nodes, in world space.
std::vector<render::WorldLight> lightsOf(const scene::Scene& scene);

/// A camera looks along -z of its node, y up.
std::vector<scene::Camera> camerasOf(const scene::Scene& scene);

/// One description for all: the only store's own, or the union with y up, as glTF has it.
lod::StoreDescription describe(const std::vector<render::PlacedStore>& placed);

/// What a camera must see: points on the outside of all stores, in world space.
std::vector<glm::dvec3> outlineOf(const std::vector<render::PlacedStore>& placed);

/// Those that are placed, each once, without proxies.
std::vector<std::shared_ptr<const lod::Store>> storesOf(const std::vector<render::PlacedStore>& placed);

/// Are there points, and not only as proxies?
bool hasPoints(const std::vector<render::PlacedStore>& placed);
/// Is any of it points, curves or triangles without materials, which --material is told of?
bool takesMaterial(const std::vector<render::PlacedStore>& placed);
/// Is any of it, or what --material says, so smooth that the environment is seen in it?
bool hasMirrors(const std::vector<render::PlacedStore>& placed, const std::optional<lod::PointMaterial>& given);
/// Have any surfels weights of their own (stipple build --surfel-weights)?
bool hasSurfelWeights(const std::vector<render::PlacedStore>& placed);

}  // namespace stipple::scene
