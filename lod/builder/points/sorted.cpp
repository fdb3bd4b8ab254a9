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

/// Runs of one key: by place, then by all that the records hold. Calls keep(place's begin, end) for each place,
/// which may write what lies before its end.
template <typename K, typename PlaceOf, typename IsLess, typename Keep>
void sortTies(std::vector<Keyed<K>>& order, const PlaceOf& placeOf, const IsLess& isLess, const Keep& keep) {
    for (size_t begin = 0; begin < order.size();) {
        size_t end = begin + 1;
        while (end < order.size() && order[end].key == order[begin].key) ++end;
        if (end - begin == 1) {
            keep(begin, end);
            begin = end;
            continue;
        }
        std::sort(order.begin() + static_cast<ptrdiff_t>(begin), order.begin() + static_cast<ptrdiff_t>(end), isLess);
        for (size_t at = begin; at < end;) {
            size_t next = at + 1;
            while (next < end && isSame(placeOf(order[next].index), placeOf(order[at].index))) ++next;
            keep(at, next);
            at = next;
        }
        begin = end;
    }
}

}  // namespace

namespace {

template <typename K>
SortResult sortBytesBy(const Frame& frame, const RecordLayout& layout, std::span<const uint8_t> bytes,
                       bool mergeDuplicates) {
    SortResult result;
    const size_t stride = layout.bytes(), count = bytes.size() / stride;
    const auto recordAt = [&](size_t i) { return bytes.data() + i * stride; };
    const auto placeOf = [&](size_t i) { return layout.placeAt(recordAt(i)); };
    std::vector<Keyed<K>> order = inOrder<K>(frame, count, placeOf);
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    size_t kept = 0;
    const auto isLess = [&](const Keyed<K>& a, const Keyed<K>& b) {
        return std::memcmp(recordAt(a.index), recordAt(b.index), stride) < 0;
    };
    sortTies(order, placeOf, isLess, [&](size_t begin, size_t end) {
        const size_t stays = std::min(end - begin, most);
        for (size_t i = begin; i < begin + stays; ++i) order[kept++] = order[i];
        (mergeDuplicates ? result.merged : result.tooMany) += end - begin - stays;
    });
    SortedPoints& sorted = result.sorted;
    layout.resize(sorted.points, kept);
    resizeHuge(sorted.key, kept);
    for (size_t i = 0; i < kept; ++i) {
        layout.read(recordAt(order[i].index), i, sorted.points);
        sorted.key[i] = order[i].key;
    }
    return result;
}

/// Keys of 64 bits do for all but the widest scenes, and move half the bytes.
SortResult sortBytes(const Frame& frame, const RecordLayout& layout, std::span<const uint8_t> bytes,
                     bool mergeDuplicates) {
    return frame.keyLevels > kShortBits ? sortBytesBy<Key>(frame, layout, bytes, mergeDuplicates)
                                        : sortBytesBy<uint64_t>(frame, layout, bytes, mergeDuplicates);
}

}  // namespace

Result<SortResult> sortBucket(const Frame& frame, const RecordLayout& layout, Spill& bucket, bool mergeDuplicates,
                              uint64_t most) {
    const size_t stride = layout.bytes();
    if (bucket.bytes() <= most * stride) {
        std::vector<uint8_t> held;
        STIPPLE_ASSIGN(const std::span<const uint8_t> bytes, bucket.look(held));
        SortResult result = sortBytes(frame, layout, bytes, mergeDuplicates);
        bucket.release();
        return result;
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
    bucket.release();
    result.tooMany = tooMany;
    result.merged = merged;
    return result;
}

namespace {

template <typename K>
Places sortGhostsBy(const Frame& frame, const RecordLayout& layout, const std::vector<uint8_t>& bytes,
                    bool mergeDuplicates) {
    const size_t stride = layout.ghostBytes(), count = bytes.size() / stride;
    const auto ghostAt = [&](size_t i) { return bytes.data() + i * stride; };
    const auto placeOf = [&](size_t i) { return layout.placeAt(ghostAt(i)); };
    std::vector<Keyed<K>> order = inOrder<K>(frame, count, placeOf);
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    Places out;
    const auto isLess = [&](const Keyed<K>& a, const Keyed<K>& b) {
        return std::memcmp(ghostAt(a.index), ghostAt(b.index), stride) < 0;
    };
    sortTies(order, placeOf, isLess, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < std::min(end, begin + most); ++i) {
            const Place place = placeOf(order[i].index);
            out.key.push_back(order[i].key);
            out.x.push_back(static_cast<uint32_t>(place[0]));
            out.y.push_back(static_cast<uint32_t>(place[1]));
            out.z.push_back(static_cast<uint32_t>(place[2]));
            if (layout.isWide()) out.high.push_back(highOf(place));
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
