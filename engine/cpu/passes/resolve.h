// Rows of pixels from the visibility buffer to texels: by a pass over the frame where a pyramid is made of them, else
// in the run of rows that shows them (rows.cpp), so that they never leave the cache.
#pragma once

#include <array>

#include "engine/cpu/passes/passes.h"

namespace stipple::cpu {

class RowResolver {
  public:
    /// Planes that the frame's pixels need beside their texels are there from here on.
    explicit RowResolver(Frame& frame);
    /// Of rows of nothing but points that are what their pixels show: do depths matter, and are they rounded?
    void setPoints(bool needsDepths, bool rounds) {
        input_.needsDepths = needsDepths;
        input_.roundsPoints = rounds && input_.exactPoints;
    }
    RowResolver(const RowResolver&) = delete;
    RowResolver& operator=(const RowResolver&) = delete;

    /// Texels of `n` pixels of row `y` from `x0` on; empties their entries of the visibility buffer. False if nothing
    /// is there. `closedUp`: see Kernels::resolveRow.
    bool resolve(uint32_t x0, uint32_t y, uint32_t n, TexelRow& row, ClosedUpRow& closedUp, float& largestRadius) const;
    /// All rows that hold something have been resolved.
    void finish() const;

  private:
    Frame& frame_;
    std::array<ResolveKind, shared::kKindNothing> ofKind_{};
    ResolveInput input_;
};

}  // namespace stipple::cpu
