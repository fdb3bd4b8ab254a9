#include "lod/builder/octree/cells.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/base/check.h"
#include "engine/base/wide.h"

namespace stipple::lod {
namespace {

constexpr double kPointsPerCell = 16384;  ///< of the first level, if the points are spread over a surface
constexpr uint32_t kLargestFirstLevel = 7;

}  // namespace

STIPPLE_WIDE static void makeCodes(const uint32_t* x, const uint32_t* y, const uint32_t* z, size_t count, uint32_t drop,
                                   uint64_t* codes) {
    for (size_t k = 0; k < count; ++k) codes[k] = shortMortonCode(x[k] >> drop, y[k] >> drop, z[k] >> drop);
}

STIPPLE_WIDE static void splitCodes(const uint64_t* codes, size_t count, uint32_t shift, uint32_t* to) {
    for (size_t k = 0; k < count; ++k) to[k] = static_cast<uint32_t>(compactShort(codes[k] >> shift));
}

void placesOfShortKeys(const uint64_t* keys, size_t count, uint32_t* x, uint32_t* y, uint32_t* z) {
    splitCodes(keys, count, 0, x);
    splitCodes(keys, count, 1, y);
    splitCodes(keys, count, 2, z);
}

void makeShortKeys(const Frame& frame, const uint32_t* x, const uint32_t* y, const uint32_t* z, size_t count,
                   uint64_t* keys) {
    makeCodes(x, y, z, count, frame.rootLog2 - frame.keyLevels, keys);
}

CellTree::CellTree(const Frame& frame, uint64_t points) : frame_(frame) {
    const double level = std::round(0.5 * std::log2(std::max(static_cast<double>(points) / kPointsPerCell, 1.0)));
    firstLevel_ = std::min({static_cast<uint32_t>(level), kLargestFirstLevel, frame.keyLevels});
    deepest_ = firstLevel_;
    firstShift_ = frame.shiftOf(firstLevel_);
    entries_.assign(size_t{1} << (3 * firstLevel_), 0);
}

void CellTree::count(const Coordinates& block) {
    size_t last = 0;
    uint32_t run = 0;
    const auto flush = [&] {
        if (run > 0) std::atomic_ref(entries_[last]).fetch_add(run, std::memory_order_relaxed);
    };
    forEachKey(frame_, block, [&](size_t, auto key) {
        const size_t place = placeOf(key, [&](size_t e) {
            return std::atomic_ref(entries_[e]).load(std::memory_order_relaxed);  // others count too
        });
        if (place != last) {
            flush();
            last = place;
            run = 0;
        }
        ++run;
    });
    flush();
}

void CellTree::walk(size_t first, uint32_t entries, Key key, uint32_t level, bool isSplit) {
    const uint32_t shift = frame_.shiftOf(level);
    for (uint32_t k = 0; k < entries; ++k) {
        const size_t place = first + k;
        const Key at = key | Key{k} << shift;
        const uint32_t steps = std::min(kSplitLevels, shift / 3);
        if ((entries_[place] & kBlock) != 0) {
            walk(entries_[place] & ~kBlock, 1u << (3 * steps), at, level + steps, isSplit);
            continue;
        }
        const uint32_t count = entries_[place];
        if (!isSplit) {
            entries_[place] = count > 0 ? static_cast<uint32_t>(cells_.size()) : kNone;
            if (count > 0) cells_.push_back({at, count, static_cast<uint8_t>(level)});
            continue;
        }
        entries_[place] = 0;
        if (count <= most_ || steps == 0) continue;
        STIPPLE_CHECK(entries_.size() + (size_t{1} << (3 * steps)) < kBlock, "cells to count");
        entries_[place] = static_cast<uint32_t>(entries_.size()) | kBlock;
        entries_.resize(entries_.size() + (size_t{1} << (3 * steps)), 0);
        deepest_ = std::max(deepest_, level + steps);
        wasSplit_ = true;
    }
}

bool CellTree::split(uint64_t most) {
    const bool isNeeded =
        std::any_of(entries_.begin(), entries_.end(), [&](uint32_t e) { return (e & kBlock) == 0 && e > most; });
    if (!isNeeded) return false;
    const std::vector<uint32_t> before = entries_;
    wasSplit_ = false;
    most_ = most;
    walk(0, 1u << (3 * firstLevel_), 0, firstLevel_, true);
    if (!wasSplit_) entries_ = before;  // only cells of the deepest level are too full
    return wasSplit_;
}

void CellTree::addUp(const std::function<void(std::vector<uint32_t>&)>& sum) {
    std::vector<uint32_t> counts = entries_;
    for (uint32_t& c : counts)
        if ((c & kBlock) != 0) c = 0;  // the same everywhere
    sum(counts);
    for (size_t i = 0; i < counts.size(); ++i)
        if ((entries_[i] & kBlock) == 0) entries_[i] = counts[i];
}

void CellTree::expect(const Coordinates& sample, uint64_t share) {
    // (A sample of few points says too little of a cell that is about as full as it may be: to count all points again
    // takes longer than to count some cells in eight parts.)
    do count(sample);
    while (split(std::max<uint64_t>(kSubtreePoints * 3 / 4 / share, 1)));
    for (uint32_t& e : entries_)
        if ((e & kBlock) == 0) e = 0;
}

/// Blocks that hold no more than a cell may become one again; returns what all the entries hold.
uint64_t CellTree::collapse(size_t first, uint32_t entries, uint32_t level) {
    uint64_t sum = 0;
    const uint32_t steps = std::min(kSplitLevels, frame_.shiftOf(level) / 3);
    for (size_t place = first; place < first + entries; ++place) {
        if ((entries_[place] & kBlock) == 0) {
            sum += entries_[place];
            continue;
        }
        const uint64_t below = collapse(entries_[place] & ~kBlock, 1u << (3 * steps), level + steps);
        if (below <= kSubtreePoints) entries_[place] = static_cast<uint32_t>(below);
        sum += below;
    }
    return sum;
}

void CellTree::finish() {
    collapse(0, 1u << (3 * firstLevel_), firstLevel_);
    walk(0, 1u << (3 * firstLevel_), 0, firstLevel_, false);
    deepest_ = firstLevel_;
    for (const Cell& c : cells_) deepest_ = std::max<uint32_t>(deepest_, c.level);
    std::vector<std::pair<double, uint64_t>> spacings;
    uint64_t all = 0, below = 0;
    for (const Cell& c : cells_) {
        spacings.emplace_back(frame_.cellSize(c.level) / std::sqrt(static_cast<double>(c.count)), c.count);
        all += c.count;
    }
    std::sort(spacings.begin(), spacings.end());
    for (const auto& [spacing, count] : spacings) {
        largeSpacing_ = spacing;
        if ((below += count) * 100 >= all * 95) break;
    }
}

void CellTree::findSubtrees(size_t begin, size_t end, uint32_t level, std::vector<Subtree>& subtrees) const {
    uint64_t count = 0;
    for (size_t i = begin; i < end && count <= kSubtreePoints; ++i) count += cells_[i].count;
    if (count <= kSubtreePoints || cells_[begin].level == level) {
        if (count > kSubtreePoints) count = cells_[begin].count;
        const uint32_t shift = frame_.shiftOf(level);
        subtrees.push_back({cells_[begin].key >> shift << shift, count, static_cast<uint8_t>(level),
                            static_cast<uint32_t>(begin), static_cast<uint32_t>(end - begin)});
        return;
    }
    const uint32_t shift = frame_.shiftOf(level + 1);
    while (begin < end) {
        const Key child = cells_[begin].key >> shift;
        size_t next = begin;
        while (next < end && cells_[next].key >> shift == child) ++next;
        findSubtrees(begin, next, level + 1, subtrees);
        begin = next;
    }
}

std::vector<Subtree> CellTree::subtrees() const {
    std::vector<Subtree> subtrees;
    if (!cells_.empty()) findSubtrees(0, cells_.size(), 0, subtrees);
    return subtrees;
}

void CellTree::save(ByteWriter& to) const {
    to.put(firstLevel_);
    to.put(deepest_);
    to.put(largeSpacing_);
    to.put(entries_);
    to.put(cells_);
}
void CellTree::load(ByteReader& from) {
    from.get(firstLevel_);
    from.get(deepest_);
    from.get(largeSpacing_);
    from.get(entries_);
    from.get(cells_);
    firstShift_ = frame_.shiftOf(firstLevel_);
}

}  // namespace stipple::lod
