// One level of the pyramid in memory: packed texels, and which parts of its rows hold any. The texels of a tile lie
// side by side, row after row, so that whoever goes through it goes through memory: of a row first all depths, then all
// sizes and so on, which are its planes.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/base/huge_buffer.h"
#include "engine/cpu/kernels.h"

namespace stipple::cpu {

constexpr uint32_t kTileRows = 32;  ///< of a tile, which is a task

class Level {
  public:
    uint32_t width = 0, height = 0;

    /// `mayCloseUp`: rows of tiles may be closed up (closeUp).
    void resize(uint32_t w, uint32_t h, bool hasMaterials, bool mayCloseUp) {
        width = w;
        height = h;
        hasMaterials_ = hasMaterials;
        tiles_ = (w + kTile - 1) / kTile;
        columns_ = std::min(wholeGroups(w), kTile);
        rowsOfTile_ = std::min(h, kTileRows);
        const size_t bands = (h + rowsOfTile_ - 1) / rowsOfTile_;
        words_.assign(bands * tiles_ * rowsOfTile_ * wordsOfRow() + kTexelGroup, 0);  // (groups are read as wholes)
        closedUp_.assign(mayCloseUp ? size_t{h} * tiles_ : 0, {});
        perRow_ = (w + kSegment - 1) / kSegment;
        filled_.assign(size_t{perRow_} * h, 0);
    }
    /// Of the texels of a row from `x` on, up to the end of the tile.
    Planes planes(uint32_t y, uint32_t x) { return planesOf(firstOfRow(y, x) + x % kTile, columns_); }
    /// Of a row of a tile that is closed up to so many texels, which lie side by side without gaps between planes.
    Planes planesClosedUp(uint32_t y, uint32_t x, uint32_t texels) {
        return planesOf(firstOfRow(y, x), wholeGroups(texels));
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
    /// It is these from now on, of which the planes hold all; depths of those that held some before become 0 (but of a
    /// level whose rows may be closed up: there nothing of groups without any is read).
    void hold(uint32_t y, uint32_t x, uint32_t n, uint32_t groups) {
        if (!closedUp_.empty())
            closedUp_[tileRow(y, x)] = {};
        else
            clear(y, x, n, held(y, x, n) & ~groups);
        setHeld(y, x, n, groups);
    }
    /// The row of a tile, of `n` texels, is these from now on; planesClosedUp hold them.
    void closeUp(uint32_t y, uint32_t x, uint32_t n, const RowBits& texels) {
        uint32_t groups = 0;
        for (uint32_t g = 0; g * kTexelGroup < n; ++g) groups |= (texels.group(g) != 0 ? 1u : 0u) << g;
        setHeld(y, x, n, groups);
        closedUp_[tileRow(y, x)] = texels;
    }
    /// Those of such a row; of none if it is not closed up.
    RowBits closedUp(uint32_t y, uint32_t x) const { return closedUp_.empty() ? RowBits{} : closedUp_[tileRow(y, x)]; }
    /// None is there.
    void empty(uint32_t y, uint32_t x, uint32_t n) {
        if (mayHold(y, x, n)) hold(y, x, n, 0);
    }

  private:
    /// Texels of a segment, whose groups share a byte: half a tile, so that what two tiles are merged to is no segment
    /// of both.
    static constexpr uint32_t kSegment = kTile / 2, kSegmentGroups = kSegment / kTexelGroup,
                              kSegmentMask = (1u << kSegmentGroups) - 1;
    void setHeld(uint32_t y, uint32_t x, uint32_t n, uint32_t groups) {
        uint8_t* const at = filled_.data() + size_t{y} * perRow_ + x / kSegment;
        at[0] = static_cast<uint8_t>(groups & kSegmentMask);
        if (n > kSegment) at[1] = static_cast<uint8_t>(groups >> kSegmentGroups);
    }
    void clear(uint32_t y, uint32_t x, uint32_t n, uint32_t groups) {
        float* const depth = planes(y, x).depth;
        for (uint32_t rest = groups; rest != 0; rest &= rest - 1) {
            const uint32_t first = static_cast<uint32_t>(std::countr_zero(rest)) * kTexelGroup;
            std::fill_n(depth + first, std::min(kTexelGroup, n - first), 0.0f);
        }
    }
    size_t tileRow(uint32_t y, uint32_t x) const { return size_t{y} * tiles_ + x / kTile; }
    size_t wordsOfRow() const { return (hasMaterials_ ? size_t{6} : size_t{5}) * columns_; }
    uint32_t* firstOfRow(uint32_t y, uint32_t x) {
        const size_t tile = size_t{y / rowsOfTile_} * tiles_ + x / kTile;
        return words_.data() + (tile * rowsOfTile_ + y % rowsOfTile_) * wordsOfRow();
    }
    Planes planesOf(uint32_t* p, size_t n) const {
        return {reinterpret_cast<float*>(p),        p + n, p + 2 * n, p + 3 * n, p + 4 * n,
                hasMaterials_ ? p + 5 * n : nullptr};
    }
    HugeBuffer<uint32_t> words_;
    std::vector<RowBits> closedUp_;                                   ///< of the rows of tiles
    uint32_t perRow_ = 0, tiles_ = 0, columns_ = 0, rowsOfTile_ = 1;  ///< columns_: of a tile
    bool hasMaterials_ = false;
    std::vector<uint8_t> filled_;  ///< of each segment its groups
};

}  // namespace stipple::cpu
