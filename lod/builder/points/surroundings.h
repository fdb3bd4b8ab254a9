// Where points of a bucket and the ghosts around it are found by the lattice: what a block of the estimates can see.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "lod/builder/points/estimate.h"
#include "lod/builder/points/inside.h"
#include "lod/builder/points/lattice_box.h"
#include "lod/builder/points/sorted_keys.h"

namespace stipple::lod {

/// A bucket and the ghosts around it. K: Key, or uint64_t where that holds all keys, which is most often and faster.
template <typename K>
struct SeenKeys {
    SortedKeys<K> own, ghosts;
    SeenKeys(const Places& ghostPlaces, const SortedPoints& ownPoints) : own(ownPoints.key), ghosts(ghostPlaces.key) {}
};

/// Of one counted cell at a time.
template <typename K>
class Surroundings {
  protected:
    /// `keys`: of `ghosts` and `own`.
    Surroundings(const Frame& frame, const CellTree& tree, const SeenKeys<K>& keys, const Places& ghosts,
                 SortedPoints& own)
        : frame_(frame), tree_(tree), ghosts_(ghosts), own_(own), allKeys_(keys), keys_(keys.own.all()) {}

    void setCell(const Cell& c) {
        cell_ = c;
        cellShift_ = frame_.shiftOf(c.level);
        cellBox_ = boxOf(static_cast<K>(c.key), c.level);
        reach_ = static_cast<int64_t>(frame_.cellSize(c.level)) / 4;
    }

    /// Of the cell of `level` that holds `place`.
    LatticeBox boxOf(K place, uint32_t level) const {
        const uint32_t drop = frame_.rootLog2 - frame_.keyLevels, shift = frame_.shiftOf(level);
        const K key = place >> shift << shift;
        const auto size = static_cast<int64_t>(frame_.cellSize(level));
        LatticeBox b;
        for (size_t a = 0; a < 3; ++a) {
            b.lo[a] = static_cast<int64_t>(compactBits(key >> a) << drop);
            b.hi[a] = b.lo[a] + size - 1;
        }
        return b;
    }
    using Range = KeyRange;
    Range allOwn() const { return {0, keys_.size()}; }
    const std::vector<K>& ghostKeys() const { return allKeys_.ghosts.all(); }
    Range allGhosts() const { return {0, ghostKeys().size()}; }

    /// Calls f(begin, end) for each child of a cell of `level` that holds some of [begin, end).
    template <typename F>
    void forChildren(size_t begin, size_t end, uint32_t level, const F& f) {
        const uint32_t shift = frame_.shiftOf(level + 1);
        while (begin < end) {
            const Range child = keyRange(keys_, keys_[begin], shift, {begin, end});
            f(begin, child.second);
            begin = child.second;
        }
    }

    /// Calls f(x, y, z) for every point inside `box` that the counted cell sees, in the order of the keys: own first,
    /// then ghosts.
    template <typename F>
    void forPoints(const LatticeBox& box, K key, uint32_t level, const Range& own, const Range& ghosts,
                   const F& f) const {
        const uint32_t shift = frame_.shiftOf(level);
        const auto [begin, end] = keyRange(keys_, key, shift, own);
        descend(keys_, own_.points, begin, end, level, box, f);
        const auto [first, last] = keyRange(ghostKeys(), key, shift, ghosts);
        descend(ghostKeys(), ghosts_, first, last, level, box, f);
    }
    /// Calls f(x, y, z) for point i.
    template <typename Of, typename F>
    static auto withPlace(const Of& points, size_t i, const F& f) {
        if (points.high.empty()) return f(points.x[i], points.y[i], points.z[i]);
        const Place p = placeOf(points.x[i], points.y[i], points.z[i], points.high[i]);
        return f(static_cast<int64_t>(p[0]), static_cast<int64_t>(p[1]), static_cast<int64_t>(p[2]));
    }
    template <typename Of, typename F>
    void descend(const std::vector<K>& keys, const Of& points, size_t begin, size_t end, uint32_t level,
                 const LatticeBox& box, const F& f) const {
        constexpr size_t kFew = kMostInside;  // what one findInside looks at
        if (begin == end) return;
        if (end - begin <= kFew || level >= frame_.keyLevels) {
            const auto see = [&](size_t i, int64_t x, int64_t y, int64_t z) {
                if (isSeen(keys[i], x, y, z)) f(x, y, z);
            };
            if (points.high.empty()) {
                forInside({points.x.data(), points.y.data(), points.z.data()}, begin, end, box,
                          [&](size_t i) { see(i, points.x[i], points.y[i], points.z[i]); });
                return;
            }
            for (size_t i = begin; i < end; ++i)
                withPlace(points, i, [&](int64_t x, int64_t y, int64_t z) {
                    if (box.holds(x, y, z)) see(i, x, y, z);
                });
            return;
        }
        const uint32_t shift = frame_.shiftOf(level + 1);
        while (begin < end) {
            const K child = keys[begin] >> shift;
            const auto next = static_cast<size_t>(std::partition_point(keys.begin() + static_cast<ptrdiff_t>(begin),
                                                                       keys.begin() + static_cast<ptrdiff_t>(end),
                                                                       [&](K k) { return k >> shift == child; }) -
                                                  keys.begin());
            const LatticeBox at = boxOf(child << shift, level + 1);
            bool meets = true;
            for (size_t a = 0; a < 3; ++a) meets = meets && at.lo[a] <= box.hi[a] && at.hi[a] >= box.lo[a];
            if (meets) descend(keys, points, begin, next, level + 1, box, f);
            begin = next;
        }
    }
    /// The rule of Distributor.
    bool isSeen(K key, int64_t x, int64_t y, int64_t z) const {
        if (key >> cellShift_ == static_cast<K>(cell_.key) >> cellShift_) return true;
        int64_t reach = reach_;
        if (tree_.deepestLevel() > tree_.firstLevel()) {
            const Cell& other = tree_.cells()[tree_.cellOf(key)];
            reach = std::min(reach, static_cast<int64_t>(frame_.cellSize(other.level)) / 4);
        }
        return cellBox_.grown(reach).holds(x, y, z);
    }

    /// Everything within `margin` of the box of a cell of `level`, from that cell and its neighbours.
    template <typename F>
    void forNeighbourhood(K key, uint32_t level, int64_t margin, bool withOwn, const F& f) const {
        const LatticeBox own = boxOf(key, level), box = own.grown(margin);
        const auto size = static_cast<int64_t>(frame_.cellSize(level)), root = int64_t{1} << frame_.rootLog2;
        for (int64_t dz = -1; dz <= 1; ++dz)
            for (int64_t dy = -1; dy <= 1; ++dy)
                for (int64_t dx = -1; dx <= 1; ++dx) {
                    if (!withOwn && dx == 0 && dy == 0 && dz == 0) continue;
                    const int64_t x = own.lo[0] + dx * size, y = own.lo[1] + dy * size, z = own.lo[2] + dz * size;
                    if (x < 0 || y < 0 || z < 0 || x >= root || y >= root || z >= root) continue;
                    const auto at = static_cast<K>(
                        frame_.keyOf(static_cast<uint64_t>(x), static_cast<uint64_t>(y), static_cast<uint64_t>(z)));
                    const Around* const near = level >= blockLevel_ ? &around_.at(aroundOf(x, y, z)) : nullptr;
                    forPoints(box, at, level, near != nullptr ? near->own : allOwn(),
                              near != nullptr ? near->ghosts : allGhosts(), f);
                }
    }

    /// Where the points of a block and its neighbours of the same size stand: the finer cells beside its own are there.
    struct Around {
        Range own{0, 0}, ghosts{0, 0};
    };
    size_t aroundOf(int64_t x, int64_t y, int64_t z) const {
        const uint32_t log2 = frame_.rootLog2 - blockLevel_;
        const auto step = [&](int64_t v, size_t a) { return static_cast<size_t>((v >> log2) - blockAt_.at(a) + 1); };
        return (step(z, 2) * 3 + step(y, 1)) * 3 + step(x, 0);
    }
    void findAround(K key, uint32_t level) {
        const LatticeBox box = boxOf(key, level);
        const uint32_t log2 = frame_.rootLog2 - level;
        const int64_t root = int64_t{1} << frame_.rootLog2;
        blockLevel_ = level;
        for (size_t a = 0; a < 3; ++a) blockAt_.at(a) = box.lo.at(a) >> log2;
        for (int64_t k = 0; k < 27; ++k) {
            const int64_t x = (blockAt_[0] + k % 3 - 1) << log2, y = (blockAt_[1] + k / 3 % 3 - 1) << log2,
                          z = (blockAt_[2] + k / 9 - 1) << log2;
            Around& to = around_.at(static_cast<size_t>(k)) = {};
            if (x < 0 || y < 0 || z < 0 || x >= root || y >= root || z >= root) continue;
            const auto at = static_cast<K>(
                frame_.keyOf(static_cast<uint64_t>(x), static_cast<uint64_t>(y), static_cast<uint64_t>(z)));
            to.own = allKeys_.own.range(at, frame_.shiftOf(level));
            to.ghosts = allKeys_.ghosts.range(at, frame_.shiftOf(level));
        }
    }

    const Frame& frame_;
    const CellTree& tree_;
    const Places& ghosts_;
    SortedPoints& own_;
    const SeenKeys<K>& allKeys_;
    const std::vector<K>& keys_;  ///< own
    Cell cell_;
    uint32_t cellShift_ = 0;

  private:
    LatticeBox cellBox_;
    int64_t reach_ = 0;
    uint32_t blockLevel_ = 0;
    std::array<int64_t, 3> blockAt_{};  ///< in its own size
    std::array<Around, 27> around_;
};

}  // namespace stipple::lod
