#include "lod/build/points/sorted.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

namespace stipple::lod {
namespace {

struct KeyIndex {
    uint64_t key;
    uint32_t index;
};

/// Stable, least significant digit first, over the bits in which the keys differ.
void radixSort(std::vector<KeyIndex>& items) {
    constexpr unsigned kDigitBits = 11, kDigits = 1u << kDigitBits;
    uint64_t any = 0, all = ~uint64_t{0};
    for (const KeyIndex& k : items) {
        any |= k.key;
        all &= k.key;
    }
    const auto bits = static_cast<unsigned>(std::bit_width(any ^ all));
    if (items.empty() || bits == 0) return;
    std::vector<KeyIndex> other(items.size());
    std::vector<uint32_t> counts(kDigits);
    for (unsigned shift = 0; shift < bits; shift += kDigitBits) {
        std::fill(counts.begin(), counts.end(), 0);
        for (const KeyIndex& k : items) ++counts[k.key >> shift & (kDigits - 1)];
        uint32_t sum = 0;
        for (uint32_t& c : counts) sum += std::exchange(c, sum);
        for (const KeyIndex& k : items) other[counts[k.key >> shift & (kDigits - 1)]++] = k;
        items.swap(other);
    }
}

template <typename T>
void permute(std::vector<T>& values, const std::vector<KeyIndex>& order) {
    std::vector<T> sorted(order.size());
    for (size_t i = 0; i < order.size(); ++i) sorted[i] = values[order[i].index];
    values.swap(sorted);
}

/// Runs of one key: by place, then by all that the records hold. Calls keep(place's begin, end) for each place.
template <typename PlaceOf, typename IsLess, typename Keep>
void sortTies(std::vector<KeyIndex>& order, const PlaceOf& placeOf, const IsLess& isLess, const Keep& keep) {
    for (size_t begin = 0; begin < order.size();) {
        size_t end = begin + 1;
        while (end < order.size() && order[end].key == order[begin].key) ++end;
        const auto first = order.begin() + static_cast<ptrdiff_t>(begin),
                   last = order.begin() + static_cast<ptrdiff_t>(end);
        if (end - begin > 1) std::sort(first, last, isLess);
        for (size_t at = begin; at < end;) {
            size_t next = at + 1;
            while (next < end && placeOf(order[next].index) == placeOf(order[at].index)) ++next;
            keep(at, next);
            at = next;
        }
        begin = end;
    }
}

}  // namespace

namespace {

SortResult sortBytes(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                     bool mergeDuplicates) {
    SortResult result;
    Points& p = result.sorted.points;
    const size_t stride = layout.bytes(), count = bytes.size() / stride;
    layout.read(bytes.data(), count, p);
    std::vector<KeyIndex> order(count);
    for (size_t i = 0; i < count; ++i) order[i] = {frame.keyOf(p.x[i], p.y[i], p.z[i]), static_cast<uint32_t>(i)};
    radixSort(order);
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    std::vector<KeyIndex> kept;
    kept.reserve(count);
    const auto placeOf = [&](uint32_t i) { return std::array<uint32_t, 3>{p.x[i], p.y[i], p.z[i]}; };
    const auto isLess = [&](const KeyIndex& a, const KeyIndex& b) {
        return std::memcmp(bytes.data() + a.index * stride, bytes.data() + b.index * stride, stride) < 0;
    };
    sortTies(order, placeOf, isLess, [&](size_t begin, size_t end) {
        const size_t stays = std::min(end - begin, most);
        kept.insert(kept.end(), order.begin() + static_cast<ptrdiff_t>(begin),
                    order.begin() + static_cast<ptrdiff_t>(begin + stays));
        (mergeDuplicates ? result.merged : result.tooMany) += end - begin - stays;
    });
    permute(p.x, kept);
    permute(p.y, kept);
    permute(p.z, kept);
    permute(p.colour, kept);
    permute(p.normal, kept);
    permute(p.radius, kept);
    for (auto& column : p.attributes) {
        const size_t width = count > 0 ? column.size() / count : 0;
        std::vector<uint8_t> sorted(kept.size() * width);
        for (size_t i = 0; i < kept.size(); ++i)
            std::memcpy(sorted.data() + i * width, column.data() + kept[i].index * width, width);
        column.swap(sorted);
    }
    result.sorted.key.resize(kept.size());
    for (size_t i = 0; i < kept.size(); ++i) result.sorted.key[i] = kept[i].key;
    return result;
}

}  // namespace

Result<SortResult> sortBucket(const Frame& frame, const RecordLayout& layout, Spill& bucket, bool mergeDuplicates,
                              uint64_t most) {
    const size_t stride = layout.bytes();
    if (bucket.bytes() <= most * stride) {
        STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, bucket.take());
        return sortBytes(frame, layout, bytes, mergeDuplicates);
    }
    // What is left out of the pieces would be left out of the whole: the first of the order stay.
    SortResult result;
    std::vector<uint8_t> kept;
    uint64_t tooMany = 0, merged = 0;
    for (uint64_t at = 0; at < bucket.bytes();) {
        const uint64_t count = std::min(bucket.bytes() - at, std::max<uint64_t>(most / 2, 1) * stride);
        STIPPLE_ASSIGN(const std::vector<uint8_t> piece, bucket.part(at, count));
        kept.insert(kept.end(), piece.begin(), piece.end());
        at += count;
        result = sortBytes(frame, layout, kept, mergeDuplicates);
        tooMany += result.tooMany;
        merged += result.merged;
        if (at == bucket.bytes()) break;
        kept.resize(result.sorted.points.size() * stride);
        for (size_t i = 0; i < result.sorted.points.size(); ++i)
            layout.write(result.sorted.points, i, kept.data() + i * stride);
    }
    result.tooMany = tooMany;
    result.merged = merged;
    return result;
}

Places sortGhosts(const Frame& frame, const std::vector<uint8_t>& bytes, bool mergeDuplicates) {
    const size_t count = bytes.size() / RecordLayout::kGhostBytes;
    std::vector<std::array<uint32_t, 3>> from(count);
    if (count > 0) std::memcpy(from.data(), bytes.data(), count * RecordLayout::kGhostBytes);
    std::vector<KeyIndex> order(count);
    for (size_t i = 0; i < count; ++i)
        order[i] = {frame.keyOf(from[i][0], from[i][1], from[i][2]), static_cast<uint32_t>(i)};
    radixSort(order);
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    Places out;
    sortTies(
        order, [&](uint32_t i) { return from[i]; },
        [&](const KeyIndex& a, const KeyIndex& b) {
            return std::memcmp(&from[a.index], &from[b.index], RecordLayout::kGhostBytes) < 0;
        },
        [&](size_t begin, size_t end) {
            for (size_t i = begin; i < std::min(end, begin + most); ++i) {
                const auto& [x, y, z] = from[order[i].index];
                out.key.push_back(order[i].key);
                out.x.push_back(x);
                out.y.push_back(y);
                out.z.push_back(z);
            }
        });
    return out;
}

}  // namespace stipple::lod
