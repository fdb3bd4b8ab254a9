#include "lod/builder/points/sorted.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "engine/base/huge_buffer.h"

namespace stipple::lod {
namespace {

template <typename K>
struct Keyed {
    K key;
    uint32_t index;
};

unsigned bitWidth(Key k) {
    const auto high = static_cast<uint64_t>(k >> 64);
    return static_cast<unsigned>(high != 0 ? 64 + std::bit_width(high) : std::bit_width(static_cast<uint64_t>(k)));
}

/// Stable, least significant digit first, over the bits in which the keys differ.
template <typename K>
void radixSort(std::vector<Keyed<K>>& items) {
    constexpr unsigned kDigitBits = 11, kDigits = 1u << kDigitBits;
    K any = 0, all = ~K{0};
    for (const Keyed<K>& k : items) {
        any |= k.key;
        all &= k.key;
    }
    const unsigned bits = bitWidth(any ^ all);
    if (items.empty() || bits == 0) return;
    std::vector<Keyed<K>> other;
    resizeHuge(other, items.size());
    std::vector<uint32_t> counts(kDigits);
    for (unsigned shift = 0; shift < bits; shift += kDigitBits) {
        std::fill(counts.begin(), counts.end(), 0);
        for (const Keyed<K>& k : items) ++counts[static_cast<size_t>(k.key >> shift & (kDigits - 1))];
        uint32_t sum = 0;
        for (uint32_t& c : counts) sum += std::exchange(c, sum);
        for (const Keyed<K>& k : items) other[counts[static_cast<size_t>(k.key >> shift & (kDigits - 1))]++] = k;
        items.swap(other);
    }
}

template <typename K, typename PlaceOf>
std::vector<Keyed<K>> inOrder(const Frame& frame, size_t count, const PlaceOf& placeOf) {
    std::vector<Keyed<K>> order;
    resizeHuge(order, count);
    for (size_t i = 0; i < count; ++i) order[i] = {static_cast<K>(frame.keyOf(placeOf(i))), static_cast<uint32_t>(i)};
    radixSort(order);
    return order;
}

template <typename T, typename K>
void permute(std::vector<T>& values, const std::vector<Keyed<K>>& order) {
    std::vector<T> sorted;
    resizeHuge(sorted, order.size());
    for (size_t i = 0; i < order.size(); ++i) sorted[i] = values[order[i].index];
    values.swap(sorted);
}

/// Runs of one key: by place, then by all that the records hold. Calls keep(place's begin, end) for each place.
template <typename K, typename PlaceOf, typename IsLess, typename Keep>
void sortTies(std::vector<Keyed<K>>& order, const PlaceOf& placeOf, const IsLess& isLess, const Keep& keep) {
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

template <typename K>
SortResult sortBytesBy(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                       bool mergeDuplicates) {
    SortResult result;
    Points& p = result.sorted.points;
    const size_t stride = layout.bytes(), count = bytes.size() / stride;
    layout.read(bytes.data(), count, p);
    std::vector<Keyed<K>> order = inOrder<K>(frame, count, [&](size_t i) { return p.place(i); });
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    std::vector<Keyed<K>> kept;
    reserveHuge(kept, count);
    const auto placeOf = [&](uint32_t i) { return p.place(i); };
    const auto isLess = [&](const Keyed<K>& a, const Keyed<K>& b) {
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
    if (!p.high.empty()) permute(p.high, kept);
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

/// Keys of 64 bits do for all but the widest scenes, and move half the bytes.
SortResult sortBytes(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                     bool mergeDuplicates) {
    return frame.keyLevels > kShortBits ? sortBytesBy<Key>(frame, layout, bytes, mergeDuplicates)
                                        : sortBytesBy<uint64_t>(frame, layout, bytes, mergeDuplicates);
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

namespace {

template <typename K>
Places sortGhostsBy(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                    bool mergeDuplicates) {
    const size_t count = bytes.size() / layout.ghostBytes();
    Points from;
    layout.readGhosts(bytes.data(), count, from);
    std::vector<Keyed<K>> order = inOrder<K>(frame, count, [&](size_t i) { return from.place(i); });
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    Places out;
    const auto bytesOf = [&](const Keyed<K>& k) { return bytes.data() + k.index * layout.ghostBytes(); };
    sortTies(
        order, [&](uint32_t i) { return from.place(i); },
        [&](const Keyed<K>& a, const Keyed<K>& b) {
            return std::memcmp(bytesOf(a), bytesOf(b), layout.ghostBytes()) < 0;
        },
        [&](size_t begin, size_t end) {
            for (size_t i = begin; i < std::min(end, begin + most); ++i) {
                const uint32_t at = order[i].index;
                out.key.push_back(order[i].key);
                out.x.push_back(from.x[at]);
                out.y.push_back(from.y[at]);
                out.z.push_back(from.z[at]);
                if (!from.high.empty()) out.high.push_back(from.high[at]);
            }
        });
    return out;
}

}  // namespace

Places sortGhosts(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                  bool mergeDuplicates) {
    return frame.keyLevels > kShortBits ? sortGhostsBy<Key>(frame, layout, bytes, mergeDuplicates)
                                        : sortGhostsBy<uint64_t>(frame, layout, bytes, mergeDuplicates);
}

}  // namespace stipple::lod
