// Which tiles of a picture show anything. No pass of rows goes through the others: their part of the picture is filled,
// those side by side together, so that what is written lies side by side, too.
#pragma once

#include <algorithm>
#include <vector>

#include "engine/base/executor.h"
#include "engine/cpu/pyramid.h"

namespace stipple::cpu {

/// Columns [x0, x0 + n), rows [row0, row1): of one tile, or of some in a band.
struct TileRect {
    uint32_t x0, n, row0, row1;
};

/// Of each tile of a picture (as Pyramid::forTiles has them) calls work(rect) if shows(rect), else empty(rect), that
/// once for all that lie side by side. Each is called by any thread.
template <typename Shows, typename Empty, typename Work>
void forShownTiles(Executor& executor, uint32_t width, uint32_t height, const Shows& shows, const Empty& empty,
                   const Work& work) {
    constexpr uint32_t kRows = kTileRows;
    const uint32_t columns = (width + kTile - 1) / kTile, bands = (height + kRows - 1) / kRows;
    const auto rectOf = [&](uint32_t band, uint32_t first, uint32_t last) {
        return TileRect{first * kTile, std::min(width, last * kTile) - first * kTile, band * kRows,
                        std::min(height, (band + 1) * kRows)};
    };
    std::vector<uint8_t> isShown(size_t{columns} * bands);
    executor.parallelFor(bands, 2, [&](size_t begin, size_t end) {
        for (auto band = static_cast<uint32_t>(begin); band < end; ++band) {
            uint8_t* const row = isShown.data() + size_t{band} * columns;
            for (uint32_t c = 0; c < columns; ++c) row[c] = shows(rectOf(band, c, c + 1)) ? 1 : 0;
            for (uint32_t c = 0; c < columns;) {
                uint32_t last = c;
                while (last < columns && row[last] == 0) ++last;
                if (last > c) empty(rectOf(band, c, last));
                c = last + 1;
            }
        }
    });
    std::vector<uint32_t> shown;
    for (uint32_t t = 0; t < isShown.size(); ++t)
        if (isShown[t] != 0) shown.push_back(t);
    const size_t grain = size_t{width} * height < 65536 ? 64 : 1;
    executor.parallelFor(shown.size(), grain, [&](size_t begin, size_t end) {
        for (size_t t = begin; t < end; ++t)
            work(rectOf(shown[t] / columns, shown[t] % columns, shown[t] % columns + 1));
    });
}

}  // namespace stipple::cpu
