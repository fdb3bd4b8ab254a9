// One level of the pyramid in memory: the planes of packed texels, and which parts of its rows hold any.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/base/huge_buffer.h"
#include "engine/cpu/kernels.h"

namespace stipple::cpu {

class Level {
  public:
    uint32_t width = 0, height = 0;

    void resize(uint32_t w, uint32_t h, bool hasMaterials) {
        width = w;
        height = h;
        hasMaterials_ = hasMaterials;
        words_.assign((hasMaterials ? size_t{6} : size_t{5}) * w * h, 0);
        perRow_ = (w + kSegment - 1) / kSegment;
        filled_.assign(size_t{perRow_} * h, 0);
    }
    Planes planes() {
        const size_t n = size_t{width} * height;
        uint32_t* p = words_.data();
        return {reinterpret_cast<float*>(p),        p + n, p + 2 * n, p + 3 * n, p + 4 * n,
                hasMaterials_ ? p + 5 * n : nullptr};
    }
    /// May any of these texels of a row be there?
    bool mayHold(uint32_t y, uint32_t x, uint32_t n) const {
        const uint8_t* const row = filled_.data() + size_t{y} * perRow_;
        bool any = false;
        for (uint32_t s = x / kSegment; s <= (x + n - 1) / kSegment; ++s) any = any || row[s] != 0;
        return any;
    }
    /// The same of a tile: columns [x0, x0 + n), rows [row0, row1).
    bool mayHoldTile(uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1) const {
        bool any = false;
        for (uint32_t y = row0; y < row1; ++y) any = any || mayHold(y, x0, n);
        return any;
    }
    /// Of the parents of a tile of the next finer level and, if `besideToo`, those beside them.
    bool mayHoldParents(uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1, bool besideToo) const {
        const uint32_t beside = besideToo ? 1 : 0, left = x0 / 2 - std::min(x0 / 2, beside),
                       top = row0 / 2 - std::min(row0 / 2, beside), right = std::min((x0 + n + 1) / 2 + beside, width),
                       bottom = std::min((row1 + 1) / 2 + beside, height);
        return mayHoldTile(left, right - left, top, bottom);
    }
    /// Which groups (kTexelGroup) of these texels hold any, a bit each. `x`: a multiple of kSegment; up to a tile.
    uint32_t held(uint32_t y, uint32_t x, uint32_t n) const {
        const uint8_t* const at = filled_.data() + size_t{y} * perRow_ + x / kSegment;
        return n <= kSegment ? at[0] : at[0] | uint32_t{at[1]} << kSegmentGroups;
    }
    /// It is these from now on, of which the planes hold all; depths of those that held some before become 0.
    void hold(uint32_t y, uint32_t x, uint32_t n, uint32_t groups) {
        uint8_t* const at = filled_.data() + size_t{y} * perRow_ + x / kSegment;
        const uint32_t gone = held(y, x, n) & ~groups;
        float* const depth = planes().depth + size_t{y} * width + x;
        for (uint32_t g = 0; gone >> g != 0; ++g)
            if ((gone >> g & 1u) != 0)
                std::fill_n(depth + g * kTexelGroup, std::min(kTexelGroup, n - g * kTexelGroup), 0.0f);
        at[0] = static_cast<uint8_t>(groups & kSegmentMask);
        if (n > kSegment) at[1] = static_cast<uint8_t>(groups >> kSegmentGroups);
    }
    /// None is there.
    void empty(uint32_t y, uint32_t x, uint32_t n) {
        if (mayHold(y, x, n)) hold(y, x, n, 0);
    }

  private:
    /// Texels of a segment, whose groups share a byte: half a tile, so that what two tiles are merged to is no segment
    /// of both.
    static constexpr uint32_t kSegment = kTile / 2, kSegmentGroups = kSegment / kTexelGroup,
                              kSegmentMask = (1u << kSegmentGroups) - 1;
    HugeBuffer<uint32_t> words_;
    uint32_t perRow_ = 0;
    bool hasMaterials_ = false;
    std::vector<uint8_t> filled_;  ///< of each segment its groups: depths of those that hold none are 0 in memory
};

}  // namespace stipple::cpu
