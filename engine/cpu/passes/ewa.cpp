// Discs blended by their kernels (shaders/shared/ewa.h), and how far they cover the pixels of silhouettes.
#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "engine/cpu/passes/passes.h"
#include "engine/cpu/passes/tile_lists.h"

namespace stipple::cpu {
namespace {

/// The discs at each pixel that are of the surface in front.
void blendDiscs(Frame& frame) {
    const size_t pixels = size_t{frame.constants.width} * frame.constants.height;
    if (frame.filteredPixels != pixels) {
        frame.filtered.assign(pixels, {});
        frame.coverage.assign(pixels, 0);
        frame.filteredPixels = pixels;
        // All 0, and no page of either is there before it is written.
        frame.secondPixels.reset(static_cast<SecondPixel*>(std::calloc(pixels, sizeof(SecondPixel))));
        frame.secondPlaces.reset(static_cast<uint32_t*>(std::calloc(pixels, sizeof(uint32_t))));
        if (!frame.secondPixels || !frame.secondPlaces) throw std::bad_alloc();
        frame.secondKinds.assign(pixels + Visibility::kRun, 0);
        frame.secondRuns.assign((pixels >> Visibility::kRunBits) + 1, 0);
    }
    frame.secondsUsed = 0;
    for (size_t r = 0; r < frame.secondRuns.size(); ++r)
        if (std::exchange(frame.secondRuns[r], uint8_t{0}) != 0)
            std::fill_n(frame.secondKinds.data() + (r << Visibility::kRunBits), Visibility::kRun, uint8_t{0});
    // (All of them: what is blended, and what light comes past a front, is not told by the nearest depth alone.)
    TileLists lists(
        frame,
        {shared::kOpaqueSpacings, 1 / shared::kOpaqueSigmas, frame.constants.kernelSupport, frame.constants.lowPass},
        frame.hidden.begin(frame, false));
    lists.place(true);
    lists.draw([&](const PlacedSplat* splats, const uint32_t* places, size_t count, const SplatTile& tile) {
        frame.k.filterTile(frame.constants, frame.tables, frame.blocks.data(), splats, frame.placedColours.data(),
                           places, count, tile, frame.wantsNormals, frame.visible(), frame.filtered.data(),
                           frame.seconds());
    });
}

/// Which pixels of a row are open, or have an open neighbour; the rows above and below the picture are not.
class OpenRows {
  public:
    explicit OpenRows(Frame& frame) : frame_(frame), near_(frame.constants.width) {
        for (auto& row : rows_) row.resize(frame.constants.width + 2);
    }
    void load(int64_t y) {
        std::vector<uint8_t>& row = rows_.at(static_cast<size_t>(y + 3) % 3);
        std::fill(row.begin(), row.end(), uint8_t{0});
        if (y < 0 || y >= frame_.constants.height) return;
        const size_t at = static_cast<size_t>(y) * frame_.constants.width;
        frame_.k.openRow(frame_.constants, frame_.visibility.data() + at, frame_.filtered.data() + at,
                         frame_.constants.width, row.data() + 1);
    }
    /// Of the middle one of the rows that were loaded last: 1 where one of nine pixels is open.
    const std::vector<uint8_t>& near() {
        const uint8_t *const a = rows_[0].data(), *const b = rows_[1].data(), *const c = rows_[2].data();
        for (size_t x = 0; x < near_.size(); ++x)
            near_[x] = static_cast<uint8_t>(a[x] | a[x + 1] | a[x + 2] | b[x] | b[x + 1] | b[x + 2] | c[x] | c[x + 1] |
                                            c[x + 2]);
        return near_;
    }

  private:
    Frame& frame_;
    std::array<std::vector<uint8_t>, 3> rows_;
    std::vector<uint8_t> near_;
};

/// The next that is not 0, from `x` on.
size_t nextNear(const std::vector<uint8_t>& near, size_t x) {
    uint64_t eight = 0;
    for (; x + sizeof(eight) <= near.size(); x += sizeof(eight)) {
        std::memcpy(&eight, near.data() + x, sizeof(eight));
        if (eight != 0) break;
    }
    while (x < near.size() && near[x] == 0) ++x;
    return x;
}

/// How far silhouettes cover their pixels.
void cover(Frame& frame) {
    const shared::FrameConstants& f = frame.constants;
    frame.forBands([&](uint32_t first, uint32_t last) {
        OpenRows open(frame);
        open.load(int64_t{first} - 1);
        open.load(first);
        for (uint32_t y = first; y <= last; ++y) {
            open.load(int64_t{y} + 1);
            const size_t at = size_t{y} * f.width;
            if (!frame.isSeen(at, f.width)) continue;
            uint8_t* const coverage = frame.coverage.data() + at;
            std::fill_n(coverage, f.width, uint8_t{255});
            const std::vector<uint8_t>& near = open.near();
            for (size_t x = 0; x < f.width; ++x) {
                if (near[x] == 0) {
                    x = nextNear(near, x) - 1;
                    continue;
                }
                if (shared::isPointKey(frame.visibility[at + x], f.firstBlock))
                    coverage[x] = static_cast<uint8_t>(frame.filtered[at + x].cover & 255u);
            }
        }
    });
}

/// Second surfaces behind fronts that end nowhere near are none: there kernels add up to less than 1 because samples
/// are not regular. (Within tiles, filterTile left those out: what is left are the edges of tiles.)
void closeSeconds(Frame& frame) {
    const shared::FrameConstants& f = frame.constants;
    const SecondPixels seconds = frame.seconds();
    const auto close = [&](size_t x, uint32_t y) {
        const size_t at = size_t{y} * f.width + x;
        if (seconds.kinds[at] <= shared::kSecondBefore) return;
        if (!frame.k.isAtJump(f, frame.visibility.data(), frame.filtered.data(), static_cast<uint32_t>(x), y,
                              seconds.at(at)->limit))
            seconds.kinds[at] = shared::kSecondNone;
    };
    frame.forBands([&](uint32_t first, uint32_t last) {
        for (uint32_t y = first; y <= last; ++y) {
            if (!seconds.mayHave(size_t{y} * f.width, f.width)) continue;
            const bool isEdge = y % SplatTile::kHeight == 0 || (y + 1) % SplatTile::kHeight == 0 || y + 1 == f.height;
            for (size_t x = 0; x < f.width; x += isEdge ? 1 : SplatTile::kWidth) {
                close(x, y);
                if (!isEdge) close(std::min(x + SplatTile::kWidth, size_t{f.width}) - 1, y);
            }
        }
    });
}

void ewa(Frame& frame) {
    blendDiscs(frame);
    cover(frame);
    closeSeconds(frame);
}

}  // namespace

constinit const CpuPass ewaPass{.run = ewa};

}  // namespace stipple::cpu
