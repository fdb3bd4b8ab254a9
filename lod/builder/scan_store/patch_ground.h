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
    /// Distances are those along the patch's own axes, in which its cells are cheap.
    struct Ground {
        const Patch* patch;
        glm::dvec3 origin;  ///< with the corner
        glm::dmat3 toLocal;
        glm::dvec3 centre;  ///< of a ball that holds it
        double radius, step, quantum;
        glm::dvec3 local(const glm::dvec3& p) const { return toLocal * (p - origin); }
    };
    struct Facet {
        uint32_t ground;
        Triangle at;  ///< along the axes of that
        double squared;
    };
    double bound(const Triangle& t, double limit, double enough, int depth, uint32_t& hint) const;
    void nearest(const glm::dvec3& p, uint32_t& hint, Facet& facet) const;
    void under(uint32_t ground, const glm::dvec3& p, Facet& facet) const;
    void around(uint32_t ground, const glm::dvec3& p, Facet& facet) const;
    void atCell(uint32_t ground, const glm::dvec3& q, uint32_t i, uint32_t j, Facet& facet) const;

    std::vector<Ground> grounds_;
};

}  // namespace stipple::lod
