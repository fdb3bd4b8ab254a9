// Discs blended by their kernels (shaders/shared/ewa.h), and how far they cover the pixels of silhouettes.
#include <array>

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
    }
    // Kernels reach as many sigmas as they have support; the low-pass of that many px adds to it.
    const float support = frame.constants.kernelSupport;
    TileLists lists(frame, {shared::kOpaqueSpacings, support / shared::kOpaqueSigmas,
                            support * std::sqrt(frame.constants.lowPass) + 0.5f});
    lists.place();
    lists.draw([&](const PlacedSplat* splats, const uint32_t* places, size_t count, const SplatTile& tile) {
        frame.k.filterTile(frame.constants, frame.tables, frame.blocks.data(), splats, frame.placedColours.data(),
                           places, count, tile, frame.visible(), frame.filtered.data());
    });
}

/// Which pixels of a row are open, or have an open neighbour beside them; the rows above and below the picture are not.
class OpenRows {
  public:
    explicit OpenRows(Frame& frame) : frame_(frame) {
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
    bool isNear(size_t x) const {
        bool any = false;
        for (const auto& row : rows_) any = any || row[x] != 0 || row[x + 1] != 0 || row[x + 2] != 0;
        return any;
    }

  private:
    Frame& frame_;
    std::array<std::vector<uint8_t>, 3> rows_;
};

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
            for (size_t x = 0; x < f.width; ++x) {
                const bool isBlended = shared::isPointKey(frame.visibility[at + x], f.firstBlock);
                frame.coverage[at + x] =
                    isBlended && open.isNear(x) ? static_cast<uint8_t>(frame.filtered[at + x].cover & 255u) : 255;
            }
        }
    });
}

void ewa(Frame& frame) {
    blendDiscs(frame);
    cover(frame);
}

}  // namespace

constinit const CpuPass ewaPass{.run = ewa};

}  // namespace stipple::cpu
