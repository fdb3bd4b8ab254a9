// Patches as a ground on which places and triangles stand: how far at most is one from it?
#pragma once

#include <array>
#include <vector>

#include "lod/primitives/patch.h"

namespace stipple::lod {

class PatchGround {
  public:
    using Triangle = std::array<glm::dvec3, 3>;
    /// Patches have to stay where they are; their origins are relative to `corner`.
    void add(const std::vector<Patch>& patches, const glm::dvec3& corner);
    /// No place of the triangle is farther from the ground than that; infinite where its middle, or that of a part of
    /// it, is farther than `limit`. What is no more than `enough` is looked at no closer. `hint`: a patch of the ground
    /// that may be near; becomes the one that was.
    double boundOf(const Triangle& triangle, double limit, double enough, uint32_t& hint) const;

  private:
    struct Ground {
        const Patch* patch;
        PatchSurface surface;
        glm::dvec3 corner, origin;  ///< origin: with the corner
        glm::dmat3 toLocal;
        glm::dvec3 centre;  ///< of a ball that holds it
        double radius;
    };
    struct Facet {
        Triangle at;
        double distance;
    };
    double bound(const Triangle& t, double limit, double enough, int depth, uint32_t& hint) const;
    void nearest(const glm::dvec3& p, uint32_t& hint, Facet& facet) const;
    static void under(const Ground& g, const glm::dvec3& p, Facet& facet);
    static void around(const Ground& g, const glm::dvec3& p, Facet& facet);
    static void atCell(const Ground& g, const glm::dvec3& p, uint32_t i, uint32_t j, Facet& facet);

    std::vector<Ground> grounds_;
};

}  // namespace stipple::lod
