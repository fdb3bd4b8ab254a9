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
    /// The same, unless it is so already.
    void fit(uint32_t w, uint32_t h, bool hasMaterials) {
        if (w != width || h != height || hasMaterials != hasMaterials_) resize(w, h, hasMaterials);
    }
    Planes planes() {
        const size_t n = size_t{width} * height;
        uint32_t* p = words_.data();
        return {reinterpret_cast<float*>(p),        p + n, p + 2 * n, p + 3 * n, p + 4 * n,
                hasMaterials_ ? p + 5 * n : nullptr};
    }
    /// May any of these texels of a row be there? If not, all their depths are 0 in memory.
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
    /// They may from now on. `x`: a multiple of kSegment.
    void hold(uint32_t y, uint32_t x, uint32_t n) { set(y, x, n, 1); }
    /// None is there.
    void empty(uint32_t y, uint32_t x, uint32_t n) {
        if (!mayHold(y, x, n)) return;
        std::fill_n(planes().depth + size_t{y} * width + x, n, 0.0f);
        set(y, x, n, 0);
    }

  private:
    /// Texels of a segment: half a tile, so that what two tiles are merged to is no segment of both.
    static constexpr uint32_t kSegment = kTile / 2;
    void set(uint32_t y, uint32_t x, uint32_t n, uint8_t value) {
        uint8_t* const row = filled_.data() + size_t{y} * perRow_;
        for (uint32_t s = x / kSegment; s <= (x + n - 1) / kSegment; ++s) row[s] = value;
    }
    HugeBuffer<uint32_t> words_;
    uint32_t perRow_ = 0;
    bool hasMaterials_ = false;
    std::vector<uint8_t> filled_;
};

}  // namespace stipple::cpu
