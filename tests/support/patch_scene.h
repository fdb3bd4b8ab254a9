// Elevation patches as a store of one node has them, to be drawn without one.
#pragma once

#include <functional>
#include <vector>

#include "engine/render/draw_list.h"
#include "engine/render/frame_passes.h"
#include "lod/primitives/patch.h"
#include "lod/primitives/point_material.h"
#include "tests/support/support.h"

namespace stipple::test {

/// Patches within [-1, 1]^3, coded and decoded again.
class PatchScene {
  public:
    explicit PatchScene(const std::vector<lod::Patch>& patches);
    const lod::Chunk& chunk() const { return chunk_; }
    /// What the patches' numbers stand for.
    void setMaterials(const std::vector<lod::PointMaterial>& list);
    const lod::Hierarchy& hierarchy() const { return hierarchy_; }
    /// All of it, placed as `place` says; it stays with the scene.
    const render::DrawList& drawsOf(const lod::View& view, const render::DrawSettings& settings = {},
                                    const lod::Instance& place = {});
    /// With depths and normals.
    render::Image draw(render::Backend& backend, const lod::View& view, render::Mode mode = render::Mode::pullpush,
                       const render::DrawSettings& settings = {}, const lod::Instance& place = {});

  private:
    lod::Hierarchy hierarchy_;
    lod::Chunk chunk_;
    lod::Instance place_;
    const lod::Hierarchy* all_ = nullptr;
    render::DrawList draws_;
};

/// One patch over the plane z = -1 of unit normal (after a turn), heights by f(x, y), on [-1, 1]^2; `holes`: cells that
/// are not drawn, by chance.
lod::Patch patchOfHeights(uint32_t width, uint32_t height, const std::function<double(double, double)>& f,
                          double holes = 0, const glm::dquat& turn = {1, 0, 0, 0});

/// Gives a patch a map of 2^density texels along a cell, texels and normals by places in samples. Empty functions: no
/// normals; numbers of materials are above the colours where `hasMaterials`.
void giveMap(lod::Patch& patch, uint32_t density, const std::function<uint32_t(double i, double j)>& texel,
             const std::function<glm::vec3(double i, double j)>& normal = {}, bool hasMaterials = false);

}  // namespace stipple::test
