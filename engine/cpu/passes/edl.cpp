// Eye-dome lighting, row by row: logarithms of depth of a tile and of what is about it are made once, and kept while
// the tile's rows go by.
#include <algorithm>
#include <array>
#include <atomic>

#include "engine/cpu/passes/passes.h"
#include "shaders/shared/bindings.h"

namespace stipple::cpu {
namespace {

using shared::EdlConstants;
constexpr uint32_t kReach = shared::kEdlReach;

/// Of some columns (kReach beyond the tile at either side), rows of the last frame in a ring.
class LogRows {
  public:
    /// Logarithms from pixel x0 of row y on; entries from -kReach to n + kReach may be read.
    const float* at(const RowPlace& place, const EdlConstants& c, int y) {
        if (place.frame.kept.serial != serial_ || place.x0 != x0_) {
            rowOf_.fill(-1);
            serial_ = place.frame.kept.serial;
            x0_ = place.x0;
        }
        const auto height = static_cast<int>(place.frame.constants.height);
        if (y < 0 || y >= height) return nothing() + kReach;
        const size_t slot = static_cast<size_t>(y) % kRing;
        float* const row = rows_.at(slot).data();
        if (rowOf_.at(slot) == y) return row + kReach;
        rowOf_.at(slot) = y;
        fill(place, c, static_cast<uint32_t>(y), row);
        return row + kReach;
    }

  private:
    static constexpr size_t kRing = 2 * kReach + 1, kWidth = kTile + 2 * kReach;
    using Row = std::array<float, kWidth>;

    static const float* nothing() {
        static const Row kRow = [] {
            Row row{};
            row.fill(shared::kEdlFar);
            return row;
        }();
        return kRow.data();
    }
    static void fill(const RowPlace& place, const EdlConstants& c, uint32_t y, float* row) {
        const uint32_t width = place.frame.constants.width;
        const uint32_t first = place.x0 - std::min(place.x0, kReach),
                       last = std::min(width, place.x0 + place.n + kReach);
        float* const begin = row + (kReach + first - place.x0);
        std::fill(row, begin, shared::kEdlFar);
        std::fill(begin + (last - first), row + kWidth, shared::kEdlFar);
        place.frame.k.edlLogs(c, place.frame.kept.depth.data() + size_t{y} * width + first, last - first, begin);
    }

    std::array<Row, kRing> rows_;
    std::array<int, kRing> rowOf_{};
    uint64_t serial_ = 0;
    uint32_t x0_ = ~0u;
};

void run(const RowPlace& at, SurfaceRow& row) {
    thread_local LogRows logs;
    const auto& c = *at.frame.draws->tableAt<EdlConstants>(shared::kEdlBinding);
    const auto y = static_cast<int>(at.y);
    const std::array straight{c.straight0, c.straight1, c.straight2}, slanted{c.slanted0, c.slanted1, c.slanted2};
    std::array<EdlRows, shared::kEdlScales> scales{};
    for (size_t k = 0; k < c.scales; ++k)
        scales.at(k) = {logs.at(at, c, y - straight.at(k)), logs.at(at, c, y + straight.at(k)),
                        logs.at(at, c, y - slanted.at(k)), logs.at(at, c, y + slanted.at(k))};
    at.frame.k.edlRow(at.frame.constants, c, logs.at(at, c, y), scales.data(), at.n, row);
}

}  // namespace

constinit const CpuPass edlPass{
    .row = {.concerns = nullptr, .wants = [](const Frame&, SurfaceWants& wants) { wants.depth = true; }, .run = run}};

}  // namespace stipple::cpu
