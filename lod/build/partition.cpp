// Sorts a cloud along the Morton curve and cuts it into an octree. Everything hangs on the lattice: the root's cell is
// the smallest power of two that holds the cloud, anchored at the lattice origin.
#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

#include "engine/base/check.h"
#include "lod/build/cloud.h"
#include "lod/build/morton.h"

namespace stipple::lod {
namespace {

struct KeyIndex {
    uint64_t key;
    uint32_t index;
};

/// Stable least-significant-digit radix sort. The number of pieces is fixed, so that the order of ties (and with it the
/// file) does not depend on the number of threads.
void radixSort(std::vector<KeyIndex>& items, unsigned keyBits, Executor& executor) {
    constexpr unsigned kDigitBits = 11, kBuckets = 1u << kDigitBits;
    constexpr size_t kPieces = 16;
    std::vector<KeyIndex> other(items.size());
    std::vector<size_t> counts(kPieces * kBuckets);
    const size_t piece = (items.size() + kPieces - 1) / kPieces;
    for (unsigned shift = 0; shift < keyBits; shift += kDigitBits) {
        std::fill(counts.begin(), counts.end(), 0);
        executor.parallelFor(kPieces, 1, [&](size_t begin, size_t end) {
            for (size_t p = begin; p < end; ++p)
                for (size_t i = p * piece; i < std::min(items.size(), (p + 1) * piece); ++i)
                    ++counts[p * kBuckets + (items[i].key >> shift & (kBuckets - 1))];
        });
        size_t sum = 0;
        for (size_t b = 0; b < kBuckets; ++b)
            for (size_t p = 0; p < kPieces; ++p) sum += std::exchange(counts[p * kBuckets + b], sum);
        executor.parallelFor(kPieces, 1, [&](size_t begin, size_t end) {
            for (size_t p = begin; p < end; ++p)
                for (size_t i = p * piece; i < std::min(items.size(), (p + 1) * piece); ++i)
                    other[counts[p * kBuckets + (items[i].key >> shift & (kBuckets - 1))]++] = items[i];
        });
        items.swap(other);
    }
}

template <typename T>
void permute(std::vector<T>& values, const std::vector<KeyIndex>& order, Executor& executor) {
    std::vector<T> sorted(values.size());
    executor.parallelFor(values.size(), 65536, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) sorted[i] = values[order[i].index];
    });
    values.swap(sorted);
}

void permute(CloudAttribute& attribute, const std::vector<KeyIndex>& order, Executor& executor) {
    const size_t width = bytesOf(attribute.info.type);
    std::vector<uint8_t> sorted(attribute.values.size());
    executor.parallelFor(order.size(), 65536, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
            std::memcpy(sorted.data() + i * width, attribute.values.data() + order[i].index * width, width);
    });
    attribute.values.swap(sorted);
}

}  // namespace

Partition partitionCloud(Cloud& cloud, uint32_t leafRecords, Executor& executor) {
    Partition p;
    uint32_t largest = 1;
    for (const auto* axis : {&cloud.x, &cloud.y, &cloud.z})
        largest = std::max(largest, *std::max_element(axis->begin(), axis->end()));
    p.rootLog2 = static_cast<uint32_t>(std::bit_width(largest));
    p.keyLevels = std::min(p.rootLog2, kMortonBits);
    const uint32_t drop = p.rootLog2 - p.keyLevels;
    std::vector<KeyIndex> order(cloud.size());
    executor.parallelFor(cloud.size(), 65536, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i)
            order[i] = {mortonCode(cloud.x[i] >> drop, cloud.y[i] >> drop, cloud.z[i] >> drop),
                        static_cast<uint32_t>(i)};
    });
    radixSort(order, 3 * p.keyLevels, executor);
    permute(cloud.x, order, executor);
    permute(cloud.y, order, executor);
    permute(cloud.z, order, executor);
    permute(cloud.colour, order, executor);
    permute(cloud.normal, order, executor);
    permute(cloud.radius, order, executor);
    for (CloudAttribute& a : cloud.attributes) permute(a, order, executor);
    p.key.resize(order.size());
    for (size_t i = 0; i < order.size(); ++i) p.key[i] = order[i].key;

    p.nodes.push_back({0, static_cast<uint32_t>(cloud.size()), 0, 0, {0, 0, 0}, 0, 0});
    p.levelBegin = {0, 1};
    for (uint32_t level = 0; p.levelBegin[level] < p.levelBegin[level + 1]; ++level) {
        for (uint32_t i = p.levelBegin[level]; i < p.levelBegin[level + 1]; ++i) {
            if (p.nodes[i].end - p.nodes[i].begin <= leafRecords || level >= p.keyLevels) continue;
            p.nodes[i].firstChild = static_cast<uint32_t>(p.nodes.size());
            const uint32_t shift = p.shiftOf(level + 1);
            uint32_t begin = p.nodes[i].begin;
            for (uint32_t octant = 0; octant < 8; ++octant) {
                const auto first = p.key.begin() + begin, last = p.key.begin() + p.nodes[i].end;
                const auto split =
                    std::partition_point(first, last, [&](uint64_t k) { return (k >> shift & 7u) <= octant; });
                const auto end = static_cast<uint32_t>(split - p.key.begin());
                if (end == begin) continue;
                p.nodes[i].childMask = static_cast<uint8_t>(p.nodes[i].childMask | 1u << octant);
                const auto& cell = p.nodes[i].cell;
                p.nodes.push_back(
                    {begin,
                     end,
                     i,
                     0,
                     {cell[0] * 2 + (octant & 1u), cell[1] * 2 + (octant >> 1 & 1u), cell[2] * 2 + (octant >> 2 & 1u)},
                     static_cast<uint8_t>(level + 1),
                     0});
                begin = end;
            }
        }
        p.levelBegin.push_back(static_cast<uint32_t>(p.nodes.size()));
    }
    p.levelBegin.pop_back();
    return p;
}

}  // namespace stipple::lod
