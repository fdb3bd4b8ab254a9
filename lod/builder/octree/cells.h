// How the points are spread, found by counting: octree cells of at most kSubtreePoints points, whatever the density.
#pragma once

#include <functional>
#include <span>

#include "lod/builder/octree/bytes.h"
#include "lod/builder/octree/frame.h"

namespace stipple::lod {

/// Subtrees of at most that many points are built as one. (A constant: what the file holds must not depend on memory.)
constexpr uint64_t kSubtreePoints = 131072;

/// A counted cell.
struct Cell {
    Key key = 0;  ///< of its corner
    uint64_t count = 0;
    uint8_t level = 0;
};

/// Of the largest octree node that is built as one.
struct Subtree {
    Key key = 0;
    uint64_t count = 0;
    uint8_t level = 0;
    uint32_t firstCell = 0, cells = 0;  ///< counted cells that it holds
};

/// Lattice coordinates of points; parallel.
struct Coordinates {
    std::span<const uint32_t> x, y, z;
    std::span<const uint64_t> high{};  ///< see Place; empty: none
    size_t size() const { return x.size(); }
    Place at(size_t i) const { return placeOf(x[i], y[i], z[i], high.empty() ? 0 : high[i]); }
};

constexpr size_t kKeysAtOnce = 256;
/// Frame::keyOf of up to so many points whose coordinates are 32 bits, by SIMD; the frame's keys must be short.
void makeShortKeys(const Frame& frame, const uint32_t* x, const uint32_t* y, const uint32_t* z, size_t count,
                   uint64_t* keys);
/// The other way, where a key is the whole place.
void placesOfShortKeys(const uint64_t* keys, size_t count, uint32_t* x, uint32_t* y, uint32_t* z);
/// Calls use(i, key of point i) in order; keys are of 64 bits where the frame's are short.
template <typename Use>
void forEachKey(const Frame& frame, const Coordinates& of, const Use& use) {
    if (frame.keyLevels > kShortBits || !of.high.empty()) {
        for (size_t i = 0; i < of.size(); ++i) use(i, frame.keyOf(of.at(i)));
        return;
    }
    std::array<uint64_t, kKeysAtOnce> keys;
    for (size_t first = 0; first < of.size(); first += keys.size()) {
        const size_t count = std::min(keys.size(), of.size() - first);
        makeShortKeys(frame, of.x.data() + first, of.y.data() + first, of.z.data() + first, count, keys.data());
        for (size_t k = 0; k < count; ++k) use(first + k, keys[k]);
    }
}

/// The root's cell split evenly into cells of a first level; where those hold more than kSubtreePoints, they are split
/// again. Counted again after each split, until nothing is left to split.
class CellTree {
  public:
    /// `points`: about how many there will be.
    CellTree(const Frame& frame, uint64_t points);

    /// Splits where a sample (every `share`-th point) says that it will be needed, which saves counting again. What was
    /// not needed is taken back in finish(): the sample does not show.
    void expect(const Coordinates& sample, uint64_t share);
    /// From several threads.
    void count(const Coordinates& block);
    /// Of several processes that counted apart: `sum` adds up what all of them have.
    void addUp(const std::function<void(std::vector<uint32_t>&)>& sum);
    /// Splits what is too full; true if so: count everything once more. Cells of the deepest level stay.
    bool split() { return split(kSubtreePoints); }
    /// Nothing more to count: numbers the cells that hold points along the Morton curve.
    void finish();

    const std::vector<Cell>& cells() const { return cells_; }
    /// Along the curve: octree nodes of at most kSubtreePoints points whose parents hold more (and cells of the deepest
    /// level, whatever they hold).
    std::vector<Subtree> subtrees() const;
    /// Number of the cell that holds `key`; kNone where there are no points.
    static constexpr uint32_t kNone = 0x7fffffffu;
    template <typename K>
    uint32_t cellOf(K key) const {
        return entries_[placeOf(key, [&](size_t i) { return entries_[i]; })];
    }
    uint32_t deepestLevel() const { return deepest_; }
    uint32_t firstLevel() const { return firstLevel_; }
    /// What 95 of 100 points have as spacing at most, if they lie on surfaces; lattice units.
    double largeSpacing() const { return largeSpacing_; }
    void save(ByteWriter& to) const;
    void load(ByteReader& from);

  private:
    static constexpr uint32_t kBlock = 0x80000000u, kSplitLevels = 3;
    bool split(uint64_t most);
    uint64_t collapse(size_t first, uint32_t entries, uint32_t level);
    void findSubtrees(size_t begin, size_t end, uint32_t level, std::vector<Subtree>& subtrees) const;
    /// `load(i)`: entry i.
    template <typename K, typename Load>
    size_t placeOf(K key, const Load& load) const {
        auto place = static_cast<size_t>(key >> firstShift_);
        uint32_t entry = load(place);
        for (uint32_t shift = firstShift_; (entry & kBlock) != 0; entry = load(place)) {
            const uint32_t steps = 3 * std::min(kSplitLevels, shift / 3);
            shift -= steps;
            place = (entry & ~kBlock) + static_cast<size_t>(key >> shift & ((1u << steps) - 1));
        }
        return place;
    }
    /// The entries of one block in order: splits (`isSplit`) or numbers them. `level`: of the entries.
    void walk(size_t first, uint32_t entries, Key key, uint32_t level, bool isSplit);

    const Frame frame_;
    uint32_t firstLevel_ = 0, firstShift_ = 0, deepest_ = 0;
    std::vector<uint32_t> entries_;  ///< a count (later a cell's number), or kBlock and where its block begins
    std::vector<Cell> cells_;
    bool wasSplit_ = false;
    uint64_t most_ = kSubtreePoints;  ///< of a cell, while splitting
    double largeSpacing_ = 0;
};

}  // namespace stipple::lod
