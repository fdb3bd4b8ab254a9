#include "lod/builder/points/sorted.h"

#include <algorithm>
#include <array>
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

/// Stable, least significant digit first, over the bits in which the keys differ: as few digits as may be, all equally
/// wide, as each of their values is a place in memory that is written to in turn.
template <typename K>
void radixSort(std::vector<Keyed<K>>& items) {
    constexpr unsigned kMostDigitBits = 11;
    K any = 0, all = ~K{0};
    for (const Keyed<K>& k : items) {
        any |= k.key;
        all &= k.key;
    }
    const unsigned bits = bitWidth(any ^ all);
    if (items.empty() || bits == 0) return;
    const unsigned digits = (bits + kMostDigitBits - 1) / kMostDigitBits, digitBits = (bits + digits - 1) / digits;
    const size_t values = size_t{1} << digitBits;
    const auto digitOf = [&](const Keyed<K>& k, unsigned digit) {
        return static_cast<size_t>(k.key >> (digit * digitBits)) & (values - 1);
    };
    std::vector<uint32_t> counts(digits * values);
    for (const Keyed<K>& k : items)
        for (unsigned d = 0; d < digits; ++d) ++counts[d * values + digitOf(k, d)];
    std::vector<Keyed<K>> other;
    resizeHuge(other, items.size());
    for (unsigned d = 0; d < digits; ++d) {
        uint32_t* const next = counts.data() + d * values;
        uint32_t sum = 0;
        for (size_t v = 0; v < values; ++v) sum += std::exchange(next[v], sum);
        for (const Keyed<K>& k : items) other[next[digitOf(k, d)]++] = k;
        items.swap(other);
    }
}

/// Records or ghosts: where their places are, and of which order.
template <typename K, typename ByteAt>
std::vector<Keyed<K>> inOrder(const Frame& frame, const RecordLayout& layout, size_t count, const ByteAt& byteAt) {
    std::vector<Keyed<K>> order;
    resizeHuge(order, count);
    if (layout.holdsKeys()) {
        for (size_t i = 0; i < count; ++i) order[i] = {RecordLayout::keyAt(byteAt(i)), static_cast<uint32_t>(i)};
    } else if (layout.isWide() || sizeof(K) > sizeof(uint64_t)) {
        for (size_t i = 0; i < count; ++i)
            order[i] = {static_cast<K>(frame.keyOf(layout.placeAt(byteAt(i)))), static_cast<uint32_t>(i)};
    } else {
        std::array<uint32_t, kKeysAtOnce> x, y, z;
        std::array<uint64_t, kKeysAtOnce> keys;
        for (size_t first = 0; first < count; first += kKeysAtOnce) {
            const size_t next = std::min(kKeysAtOnce, count - first);
            for (size_t k = 0; k < next; ++k) {
                const Place place = layout.placeAt(byteAt(first + k));
                x[k] = static_cast<uint32_t>(place[0]);
                y[k] = static_cast<uint32_t>(place[1]);
                z[k] = static_cast<uint32_t>(place[2]);
            }
            makeShortKeys(frame, x.data(), y.data(), z.data(), next, keys.data());
            for (size_t k = 0; k < next; ++k) order[first + k] = {keys[k], static_cast<uint32_t>(first + k)};
        }
    }
    radixSort(order);
    return order;
}

/// Runs of one key: by place, then by all that the records hold. Calls keep(place's begin, end) for each place,
/// which may write what lies before its end.
template <typename K, typename SamePlace, typename IsLess, typename Keep>
void sortTies(std::vector<Keyed<K>>& order, const SamePlace& areAtOnePlace, const IsLess& isLess, const Keep& keep) {
    for (size_t begin = 0; begin < order.size();) {
        size_t end = begin + 1;
        while (end < order.size() && order[end].key == order[begin].key) ++end;
        if (end - begin == 1) {
            keep(begin, end);
            begin = end;
            continue;
        }
        if (end - begin > 2)
            std::sort(order.begin() + static_cast<ptrdiff_t>(begin), order.begin() + static_cast<ptrdiff_t>(end),
                      isLess);
        else if (isLess(order[begin + 1], order[begin]))
            std::swap(order[begin], order[begin + 1]);
        for (size_t at = begin; at < end;) {
            size_t next = at + 1;
            while (next < end && areAtOnePlace(order[next].index, order[at].index)) ++next;
            keep(at, next);
            at = next;
        }
        begin = end;
    }
}

/// As std::memcmp orders them.
class BytesLess {
  public:
    explicit BytesLess(size_t count) : count_(count) {}
    bool operator()(const uint8_t* a, const uint8_t* b) const {
        size_t at = 0;
        for (; at + sizeof(uint64_t) <= count_; at += sizeof(uint64_t)) {
            const uint64_t left = wordAt(a + at), right = wordAt(b + at);
            if (left != right) return left < right;
        }
        return std::memcmp(a + at, b + at, count_ - at) < 0;
    }

  private:
    static uint64_t wordAt(const uint8_t* from) {
        uint64_t word = 0;
        std::memcpy(&word, from, sizeof(word));
        return std::endian::native == std::endian::little ? __builtin_bswap64(word) : word;
    }
    size_t count_;
};

/// Of the first `count` records, whose keys hold them.
template <typename K>
void readPlaces(const std::vector<Keyed<K>>& order, size_t count, Points& to) {
    std::array<uint64_t, kKeysAtOnce> keys;
    for (size_t first = 0; first < count; first += kKeysAtOnce) {
        const size_t next = std::min(kKeysAtOnce, count - first);
        for (size_t k = 0; k < next; ++k) keys[k] = static_cast<uint64_t>(order[first + k].key);
        placesOfShortKeys(keys.data(), next, &to.x[first], &to.y[first], &to.z[first]);
    }
}

template <typename K>
SortResult sortBytesBy(const Frame& frame, const RecordLayout& layout, std::span<const uint8_t> bytes,
                       bool mergeDuplicates) {
    SortResult result;
    const size_t stride = layout.bytes(), count = bytes.size() / stride;
    const auto recordAt = [&](size_t i) { return bytes.data() + i * stride; };
    const auto areAtOnePlace = [&](size_t a, size_t b) {
        return std::memcmp(recordAt(a), recordAt(b), layout.ghostBytes()) == 0;
    };
    std::vector<Keyed<K>> order = inOrder<K>(frame, layout, count, recordAt);
    constexpr size_t kAhead = 16;  // records asked for before their turn
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    size_t kept = 0;
    const auto isLess = [&](const Keyed<K>& a, const Keyed<K>& b) {
        return BytesLess(stride)(recordAt(a.index), recordAt(b.index));
    };
    sortTies(order, areAtOnePlace, isLess, [&](size_t begin, size_t end) {
        const size_t stays = std::min(end - begin, most);
        for (size_t i = begin; i < begin + stays; ++i) order[kept++] = order[i];
        (mergeDuplicates ? result.merged : result.tooMany) += end - begin - stays;
    });
    SortedPoints& sorted = result.sorted;
    layout.resize(sorted.points, kept);
    resizeHuge(sorted.key, kept);
    for (size_t i = 0; i < kept; ++i) {
        __builtin_prefetch(recordAt(order[std::min(i + kAhead, kept - 1)].index));
        layout.read(recordAt(order[i].index), i, sorted.points);
        sorted.key[i] = order[i].key;
    }
    if (layout.holdsKeys()) readPlaces(order, kept, sorted.points);
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
            layout.write(result.sorted.points, i, static_cast<uint64_t>(result.sorted.key[i]),
                         kept.data() + i * stride);
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
    const auto areAtOnePlace = [&](size_t a, size_t b) { return std::memcmp(ghostAt(a), ghostAt(b), stride) == 0; };
    std::vector<Keyed<K>> order = inOrder<K>(frame, layout, count, ghostAt);
    const size_t most = mergeDuplicates ? 1 : kMostAtOnePlace;
    Places out;
    const auto isLess = [&](const Keyed<K>& a, const Keyed<K>& b) {
        return BytesLess(stride)(ghostAt(a.index), ghostAt(b.index));
    };
    sortTies(order, areAtOnePlace, isLess, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < std::min(end, begin + most); ++i) {
            const Place place = layout.placeAt(ghostAt(order[i].index));
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
