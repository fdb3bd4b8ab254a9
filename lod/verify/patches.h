// The errors of patches, measured again from what the file holds.
#pragma once

#include <span>
#include <vector>

#include "lod/primitives/patch.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// Patches of a payload of them, lengths in lattice units, places relative to the lower corner of the node's cell.
Result<std::vector<Patch>> readPatches(const Store& store, uint32_t chunk);

/// What is drawn of one node: patches and discs, in lattice units.
class NodeSurface {
  public:
    static Result<NodeSurface> read(const Store& store, uint32_t node);
    /// Does any place of it lie within `distance` of `p`?
    bool isWithin(const glm::dvec3& p, double distance) const;
    /// Of the nearest place of it; `limit` where that is farther.
    double distance(const glm::dvec3& p, double limit) const;
    /// Calls use(place) for about `most` places of its patches, evenly spread over their cells.
    template <typename Use>
    void forPlaces(size_t most, const Use& use) const {
        size_t cells = 0;
        for (const Patch& p : patches_) cells += p.drawnCells();
        const size_t stride = cells / most + 1;
        size_t number = stride / 2;
        for (const Patch& p : patches_) {
            const PatchSurface surface(p);
            for (uint32_t j = 0; j + 1 < p.height; ++j)
                for (uint32_t i = 0; i + 1 < p.width; ++i)
                    if (p.hasCell(i, j) && number++ % stride == 0)
                        surface.trianglesOf(i, j, [&](size_t a, size_t b, size_t c) {
                            use(corner_ +
                                (surface.position(a) + surface.position(b) + surface.position(c)) * (1.0 / 3));
                        });
        }
    }
    const glm::dvec3& corner() const { return corner_; }

  private:
    struct Disc {
        glm::dvec3 place;
        double radius;
    };
    /// Those that may be that near to a place, by its x alone.
    std::span<const Disc> discsNear(double x, double distance) const;

    glm::dvec3 corner_{0};
    std::vector<Patch> patches_;
    std::vector<Disc> discs_;  ///< by x
    double largestDisc_ = 0;   ///< radius
};

/// Measures an inner node all of whose children are leaves against the leaves around it, both ways, at about `most`
/// places each: every place of its patches in its cell lies within its error and the leaves' rounding of a leaf, and
/// every place of a child's patches in the child's cell within that of a node of its level, or of a leaf above. An
/// error if one does not; else how many were measured (0: of other nodes).
Result<uint64_t> measurePatches(const Store& store, uint32_t chunk, uint64_t most);

}  // namespace stipple::lod
