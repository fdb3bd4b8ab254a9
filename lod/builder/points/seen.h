// What a block of the estimates sees, by window cell.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <utility>
#include <vector>

#include "lod/builder/points/points.h"
#include "lod/builder/points/surface_fit.h"

namespace stipple::lod {

using KeyRange = std::pair<size_t, size_t>;
/// Where the keys of a cell stand: those that are `key` but for the last `shift` bits; looked for `within`.
template <typename K>
KeyRange keyRange(const std::vector<K>& keys, K key, uint32_t shift, const KeyRange& within) {
    if (within.first == within.second) return within;
    const K lo = key >> shift << shift, last = lo | ((K{1} << shift) - 1);
    if (keys[within.first] >= lo && keys[within.second - 1] <= last) return within;
    const auto first = std::lower_bound(keys.begin() + static_cast<ptrdiff_t>(within.first),
                                        keys.begin() + static_cast<ptrdiff_t>(within.second), lo);
    const auto end = std::upper_bound(first, keys.begin() + static_cast<ptrdiff_t>(within.second), last);
    return {static_cast<size_t>(first - keys.begin()), static_cast<size_t>(end - keys.begin())};
}

/// Sorted keys, most of which are in few of the cells that their first bits tell apart: where those of such a cell
/// begin is in a table.
template <typename K>
class SortedKeys {
  public:
    explicit SortedKeys(std::span<const Key> keys) : keys_(keys.begin(), keys.end()) {
        if (keys_.empty()) return;
        const K extent = keys_.back() - keys_.front();
        while (extent >> shift_ >= kMostEntries) ++shift_;
        begins_.assign(static_cast<size_t>(extent >> shift_) + 2, 0);
        for (size_t i = keys_.size(); i > 0; --i) begins_[entryOf(keys_[i - 1])] = static_cast<uint32_t>(i - 1);
        begins_.back() = static_cast<uint32_t>(keys_.size());
        // (Where none begins, the next one's.)
        for (size_t e = begins_.size() - 1; e > 1; --e)
            if (keys_[begins_[e - 1]] < keys_.front() + (static_cast<K>(e - 1) << shift_)) begins_[e - 1] = begins_[e];
    }
    const std::vector<K>& all() const { return keys_; }
    /// As keyRange, among all.
    KeyRange range(K key, uint32_t shift) const {
        const K lo = key >> shift << shift, last = lo | ((K{1} << shift) - 1);
        if (keys_.empty() || last < keys_.front() || lo > keys_.back()) return {0, 0};
        const size_t first = lo > keys_.front() ? entryOf(lo) : 0, end = entryOf(std::min(last, keys_.back())) + 1;
        return keyRange(keys_, key, shift, {begins_[first], begins_[end]});
    }

  private:
    static constexpr size_t kMostEntries = size_t{1} << 16;
    size_t entryOf(K key) const { return static_cast<size_t>((key - keys_.front()) >> shift_); }
    std::vector<K> keys_;
    std::vector<uint32_t> begins_;  ///< of each entry, and the end
    uint32_t shift_ = 0;
};

/// Places around a block, first in the order they came, then by window cell. Cells are numbered x first, `across` to an
/// edge, with a layer around the block's own.
class Seen {
  public:
    struct Place {
        uint32_t cell;
        glm::vec3 at;  ///< in window cells from the block's centre
    };
    void clear() { places_.clear(); }
    void add(uint32_t cell, const glm::vec3& at) { places_.push_back({cell, at}); }
    size_t size() const { return places_.size(); }
    const Place& operator[](size_t i) const { return places_[i]; }

    /// Sorts what was added by its cell, of `cells`.
    void index(size_t cells) {
        first_.assign(cells + 1, 0);
        for (const Place& p : places_) ++first_[p.cell + 1];
        for (size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
        next_.assign(first_.begin(), first_.end());
        for (auto* axis : {&x_, &y_, &z_}) axis->resize(places_.size());
        for (const Place& p : places_) {
            const uint32_t to = next_[p.cell]++;
            x_[to] = p.at.x;
            y_[to] = p.at.y;
            z_[to] = p.at.z;
        }
    }

    /// The places of a cell and its neighbours; of more than `most` in three cells only some.
    void gather(size_t cell, uint32_t across, uint32_t most, Neighbourhood& to) const {
        std::array<std::pair<uint32_t, uint32_t>, 9> runs;
        size_t all = 0;
        for (size_t row = 0; row < 9; ++row) {  // three cells in x lie side by side
            const size_t first = cell + (row / 3 * across + row % 3) * across - (across + 1) * across - 1;
            runs.at(row) = {first_[first], first_[first + 3]};
            all += runs.at(row).second - runs.at(row).first;
        }
        to.resize(all);
        float *x = to.x.data(), *y = to.y.data(), *z = to.z.data();
        for (const auto& [begin, end] : runs) {
            const uint32_t stride = (end - begin) / most + 1;  // many lie at one place
            for (uint32_t k = begin; k < end; k += stride) {
                *x++ = x_[k];
                *y++ = y_[k];
                *z++ = z_[k];
            }
        }
        to.count = static_cast<size_t>(x - to.x.data());
    }

  private:
    std::vector<Place> places_;
    std::vector<float> x_, y_, z_;  ///< by cell
    std::vector<uint32_t> first_, next_;
};

}  // namespace stipple::lod
