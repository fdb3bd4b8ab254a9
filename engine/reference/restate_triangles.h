// Triangles in fp64, from the definitions: clipping at the near plane, coverage by the top-left rule on corners snapped
// to 1/256 pixel, attributes where the ray through the pixel meets the triangle's plane.
#pragma once

#include "engine/reference/surface.h"

namespace stipple::reference {

/// What a triangle is a part of, for debug views.
struct Whole {
    double errorPixels = 0;
    uint32_t level = 0;
    bool isLitAsPoint = false;  ///< not for debug views
};

class TriangleProjector {
  public:
    /// `isSnapped`: else pixels are those whose rays meet a triangle.
    TriangleProjector(const render::DrawList& draws, Level& level, bool isSnapped = true)
        : draws_(draws), level_(level), view_(draws.view), isSnapped_(isSnapped) {}

    /// Into the level where nothing nearer is. `surface`: flags of shaders/shared/mesh.h.
    void triangle(const Corners& c, uint32_t surface, const shared::SurfaceMaterial& material,
                  const TextureReader& textures, const Whole& of);

    /// One pixel, where nothing nearer is: what is seen there of the triangle's plane.
    void place(int x, int y, double depth, const Corners& c, const shared::SurfaceMaterial& material,
               const TextureReader& textures, const Whole& of);

  private:
    template <typename Use>
    void cover(std::array<glm::dvec2, 3> p, const Use& use) const;
    void pixel(int x, int y, const Corners& c, const glm::dvec3& face, uint32_t surface,
               const shared::SurfaceMaterial& m, const TextureReader& textures, const Whole& of);
    void store(int x, int y, double depth, const ViewRay& ray, Sample hit, const glm::dvec3& n, const Whole& of);

    const render::DrawList& draws_;
    Level& level_;
    const lod::View& view_;
    bool isSnapped_;
};

}  // namespace stipple::reference
