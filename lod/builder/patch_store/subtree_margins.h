// Which subtrees need a triangle that is another's: those near whose cell it lies.
#pragma once

#include <span>

#include "lod/builder/octree/cells.h"

namespace stipple::lod {

/// Of subtree a, the margin is `margin` of its cell's edge; for what is in a larger one's cell twice that: that one
/// sends nothing up before the level above a's, which needs it.
class SubtreeMargins {
  public:
    SubtreeMargins(const Frame& frame, const std::vector<Subtree>& subtrees, double margin);
    /// Calls use(b) for the subtrees but `own`, in which `p` lies (lattice units), that need what is there.
    template <typename Use>
    void forEachNear(uint32_t own, const glm::dvec3& p, const Use& use) const {
        for (uint32_t k = first_[own]; k < first_[own + 1]; ++k) {
            const Near& near = near_[k];
            if (glm::all(glm::lessThanEqual(near.lo, p)) && glm::all(glm::lessThanEqual(p, near.hi))) use(near.subtree);
        }
    }

  private:
    struct Near {
        glm::dvec3 lo, hi;  ///< with the margin
        uint32_t subtree;
    };
    std::vector<uint32_t> first_;  ///< one more than subtrees
    std::vector<Near> near_;
};

}  // namespace stipple::lod
