// Discs over the levels of a pyramid, drawn exactly (mode pullpush-exact; PP-B of ALGORITHMS 1.4): each texel keeps the
// nearest of the discs whose centres it holds, and a pixel takes the nearest of those about it, over all levels. What a
// texel does not keep is drawn by lists of tiles, so that nothing is lost whatever shares a texel: the picture is that
// of mode splat.
#include <algorithm>
#include <array>
#include <atomic>
#include <limits>

#include "engine/cpu/passes/passes.h"
#include "engine/cpu/passes/tile_lists.h"
#include "shaders/shared/disc_level.h"

namespace stipple::cpu {
namespace {

using shared::kLevelTaps;
using shared::kMostLevels;

/// The nearest disc of each texel: bits of its depth, and its place among Frame::placedSplats.
class DiscLevels {
  public:
    static constexpr uint64_t kNone = ~uint64_t{0};

    DiscLevels(Frame& frame, TileLists& lists)
        : frame_(frame), lists_(lists), placeOf_(frame.placedSplats.size()), isOccupied_{} {}

    void fill() {
        frame_.executor.parallelFor(lists_.chunks(), 1, [&](size_t begin, size_t end) {
            for (size_t c = begin; c < end; ++c)
                lists_.forDiscs(static_cast<uint32_t>(c), [&](size_t at) { find(at); });
        });
        for (int l = 0; l < kMostLevels; ++l)
            if (isOccupied(l)) keys_[static_cast<size_t>(l)].assign(texels(l), kNone);
        frame_.executor.parallelFor(lists_.chunks(), 1, [&](size_t begin, size_t end) {
            for (size_t c = begin; c < end; ++c)
                lists_.forDiscs(static_cast<uint32_t>(c), [&](size_t at) { offer(at); });
        });
    }

    /// Of a disc that its texel keeps.
    bool isKept(size_t at) const {
        const Place& p = placeOf_[at];
        return p.level >= 0 && keys_[static_cast<size_t>(p.level)][p.texel] == keyOf(at);
    }

    /// Calls use(place) for all discs that pixels of the tile may find.
    template <typename Use>
    void forTaps(const SplatTile& tile, const Use& use) const {
        for (int l = 0; l < kMostLevels; ++l) {
            if (!isOccupied(l)) continue;
            const auto range = [&](uint32_t first, uint32_t n, int most) {
                return std::pair(std::max((static_cast<int>(first) >> l) - kLevelTaps, 0),
                                 std::min((static_cast<int>(first + n - 1) >> l) + kLevelTaps, most - 1));
            };
            const int columns = shared::levelTexels(frame_.constants.width, l);
            const auto [x0, x1] = range(tile.x0, tile.width, columns);
            const auto [y0, y1] = range(tile.y0, tile.height, shared::levelTexels(frame_.constants.height, l));
            for (int y = y0; y <= y1; ++y) {
                const uint64_t* const row =
                    keys_[static_cast<size_t>(l)].data() + static_cast<size_t>(y) * static_cast<size_t>(columns);
                for (int x = x0; x <= x1; ++x)
                    if (row[x] != kNone) use(static_cast<uint32_t>(row[x]));
            }
        }
    }

  private:
    struct Place {
        int32_t level;
        uint32_t texel;
    };

    bool isOccupied(int level) const {
        return isOccupied_[static_cast<size_t>(level)].load(std::memory_order_relaxed) != 0;
    }
    size_t texels(int level) const {
        return static_cast<size_t>(shared::levelTexels(frame_.constants.width, level)) *
               static_cast<size_t>(shared::levelTexels(frame_.constants.height, level));
    }
    uint64_t keyOf(size_t at) const { return uint64_t{shared::floatBitsToUint(frame_.placedSplats[at].cz)} << 32 | at; }
    void find(size_t at) {
        const PlacedSplat& s = frame_.placedSplats[at];
        const shared::LevelPlace p =
            shared::levelPlace({{s.cx, s.cy, s.cz}, {s.nx, s.ny, s.nz}, s.radius, s.id}, frame_.constants);
        placeOf_[at].level = p.level;
        if (p.level < 0) return;
        placeOf_[at].texel = static_cast<uint32_t>(p.y * shared::levelTexels(frame_.constants.width, p.level) + p.x);
        std::atomic<uint8_t>& occupied = isOccupied_[static_cast<size_t>(p.level)];
        if (occupied.load(std::memory_order_relaxed) == 0) occupied.store(1, std::memory_order_relaxed);
    }
    void offer(size_t at) {
        const Place& p = placeOf_[at];
        if (p.level < 0) return;
        const std::atomic_ref<uint64_t> entry(keys_[static_cast<size_t>(p.level)][p.texel]);
        const uint64_t key = keyOf(at);
        uint64_t old = entry.load(std::memory_order_relaxed);
        while (key < old && !entry.compare_exchange_weak(old, key, std::memory_order_relaxed)) {
        }
    }

    Frame& frame_;
    TileLists& lists_;
    std::vector<Place> placeOf_;
    std::array<std::atomic<uint8_t>, kMostLevels> isOccupied_;
    std::array<std::vector<uint64_t>, kMostLevels> keys_;
};

void exact(Frame& frame) {
    TileLists lists(frame, {}, frame.hidden.begin(frame, false));
    lists.place(false);  // some are taken away before they are drawn
    DiscLevels levels(frame, lists);
    levels.fill();
    const auto draw = [&](const PlacedSplat* splats, const uint32_t* places, size_t count, const SplatTile& tile) {
        frame.k.splatTile(frame.constants, splats, places, count, tile, frame.visible());
    };
    lists.forTiles([&](const SplatTile& tile) {
        const uint32_t column = tile.x0 / SplatTile::kWidth, row = tile.y0 / SplatTile::kHeight;
        std::vector<uint32_t> found;
        levels.forTaps(tile, [&](uint32_t at) {
            const TileRange& r = frame.splatTiles[at];
            if (r.firstX <= column && column <= r.lastX && r.firstY <= row && row <= r.lastY) found.push_back(at);
        });
        std::sort(found.begin(), found.end());  // as ids are: of what is equally deep the first is drawn
        if (!found.empty()) draw(frame.placedSplats.data(), found.data(), found.size(), tile);
    });
    frame.executor.parallelFor(lists.chunks(), 1, [&](size_t begin, size_t end) {
        for (size_t c = begin; c < end; ++c)
            lists.forDiscs(c, [&](size_t at) {
                if (levels.isKept(at)) frame.splatTiles[at] = {1, 1, 0, 0};  // no tile
            });
    });
    lists.draw(draw);
}

}  // namespace

constinit const CpuPass exactPass{.run = exact};

}  // namespace stipple::cpu
