// Pull and push over the levels of the pyramid, tile by tile (Marroquim, Kraus, Cavalcanti 2008;
// shaders/shared/pyramid.h).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/base/executor.h"
#include "engine/cpu/level.h"

namespace stipple::cpu {

constexpr float kOutside = -1;  ///< depth of a texel outside the image

class Pyramid {
  public:
    Pyramid(Executor& executor, const Kernels& kernels) : executor_(executor), k_(kernels) {}

    void resize(uint32_t width, uint32_t height, bool hasMaterials);
    size_t levels() const { return levels_.size(); }
    Level& level(size_t l) { return levels_[l]; }
    /// `hasCurves`: texels may be of tubes.
    void beginFrame(const shared::FrameConstants& frame, bool hasCurves) {
        frame_ = frame;
        hasCurves_ = hasCurves;
    }
    /// Levels whose texels are larger than the largest splat hold nothing. Once level 0 and 1 are filled.
    void setLargestRadius(float radius);
    /// Is there more than level 0?
    bool isUsed() const { return levelCount_ > 1; }

    /// Level 1 to the top.
    void pull();
    /// The top to level 1.
    void push();

    /// Calls body(x0, n, row0, row1) for tiles of `level`: columns [x0, x0 + n), rows [row0, row1), row0 even.
    template <typename Body>
    void forTiles(const Level& level, const Body& body) {
        const uint32_t columns = (level.width + kTile - 1) / kTile, bands = (level.height + kTileRows - 1) / kTileRows;
        executor_.parallelFor(
            size_t{columns} * bands, level.width * level.height < 65536 ? 64 : 1, [&](size_t begin, size_t end) {
                for (size_t t = begin; t < end; ++t) {
                    const auto x0 = static_cast<uint32_t>(t % columns) * kTile,
                               row0 = static_cast<uint32_t>(t / columns) * kTileRows;
                    body(x0, std::min(kTile, level.width - x0), row0, std::min(level.height, row0 + kTileRows));
                }
            });
    }

    static void clearTubes(TexelRow& row) {
        std::fill_n(row.isRound, TexelRow::kSize, 0.0f);
        std::fill_n(row.axisX, TexelRow::kSize, 0.0f);
    }
    /// Two rows to `n` texels of row `y` of the coarser level, from `x` on.
    void pullPair(const TexelRow& upper, const TexelRow& lower, bool any, uint32_t n, float childSize, Level& to,
                  uint32_t x, uint32_t y, TexelRow& out);
    /// Unpacks n texels of a row; false (and only the depths set) if all are empty.
    bool loadRow(Level& level, uint32_t y, uint32_t x, uint32_t n, TexelRow& row, bool hasNormals = true) const;

    /// Pushes coarse into fine over one tile, row by row: use(y, own row, pushed row, any).
    /// wanted(y): groups of texels (kTexelGroup) that are, a bit each; of rows without any nothing is loaded, and `any`
    /// is false. `coloursAlone`: of rows without tubes nothing but depths, colours and materials is made.
    template <typename Wanted, typename Use>
    void pushTile(Level& fine, Level& coarse, float fineSize, uint32_t x0, uint32_t n, uint32_t row0, uint32_t row1,
                  bool coloursAlone, const Wanted& wanted, const Use& use) {
        thread_local TexelRow own{}, out{};
        thread_local std::array<CoarseRow, 3> ring{};
        own.hasTubes = out.hasTubes = hasCurves_;
        own.hasMaterials = out.hasMaterials = hasMaterials_;
        std::array<bool, 3> has{}, isEmptied{};
        std::array<int, 3> held{-2, -2, -2};
        const auto slotOf = [&](int c) {  // of coarse row c, which is there from here on
            const auto slot = static_cast<size_t>(c + 1) % 3;
            if (held.at(slot) != c) isEmptied.at(slot) = false;
            if (held.at(slot) != c) has.at(slot) = loadCoarse(coarse, 2 * fineSize, c, x0, n, ring.at(slot));
            held.at(slot) = c;
            return slot;
        };
        for (uint32_t y = row0; y < row1; ++y) {
            const uint32_t groups = wanted(y);
            if (groups == 0) {
                use(y, own, own, false);
                continue;
            }
            const auto c = static_cast<int>(y / 2), beyond = y % 2 == 0 ? c - 1 : c + 1;
            const size_t nearSlot = slotOf(c), farSlot = slotOf(beyond);
            const bool ownAny = loadRow(fine, y, x0, n, own, !coloursAlone);
            if (!has.at(nearSlot) && !has.at(farSlot)) {
                use(y, own, own, ownAny);
                continue;
            }
            for (const size_t slot : {nearSlot, farSlot}) {
                if (has.at(slot) || isEmptied.at(slot)) continue;
                isEmptied.at(slot) = true;
                const bool isOutside = slot == farSlot && (beyond < 0 || beyond >= static_cast<int>(coarse.height));
                std::fill_n(ring.at(slot).texels.depth, TexelRow::kSize, isOutside ? kOutside : 0.0f);
                k_.coarseDiscs(ring.at(slot), n, 0, 0, 2 * fineSize, frame_.focal);  // of which there are none
            }
            out.hasTubes = own.hasTubes || (has.at(nearSlot) && ring.at(nearSlot).texels.hasTubes) ||
                           (has.at(farSlot) && ring.at(farSlot).texels.hasTubes);
            k_.pushRow(own, ring.at(nearSlot), ring.at(farSlot), y % 2 == 0 ? -1.0f : 1.0f,
                       (static_cast<float>(x0) + 0.5f) * fineSize - frame_.centre.x,
                       (static_cast<float>(y) + 0.5f) * fineSize - frame_.centre.y, n, groups, fineSize, frame_.focal,
                       coloursAlone, out);
            use(y, own, out, true);
        }
    }

  private:
    /// loadRow, of texels at hand; `held`: groups of them.
    bool loadTexels(const Planes& at, uint32_t held, uint32_t to, uint32_t n, bool hasNormals, TexelRow& row) const;
    /// Of a row that is loaded soon.
    static void askFor(Level& level, uint32_t y, uint32_t x, uint32_t n, bool hasNormals);
    /// The coarse row `y` around the fine columns [x0, x0 + n), with its discs; false, and nothing is there, outside
    /// the level and where all are empty.
    bool loadCoarse(Level& level, float size, int y, uint32_t x0, uint32_t n, CoarseRow& out) const;

    Executor& executor_;
    const Kernels& k_;
    std::vector<Level> levels_;
    size_t levelCount_ = 0;
    shared::FrameConstants frame_{};
    bool hasCurves_ = false, hasMaterials_ = false;
};

}  // namespace stipple::cpu
