// Where the keys of a cell stand among sorted ones.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "lod/builder/points/points.h"

namespace stipple::lod {

using KeyRange = std::pair<size_t, size_t>;
/// Of sorted keys those that are `key` but for the last `shift` bits; looked for `within`.
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

/// Sorted keys, fewer than 2^32, most of which are in few of the cells that their first bits tell apart: where those of
/// such a cell begin is in a table.
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

}  // namespace stipple::lod
