// What the estimates look up around a block: which places lie in a box, and which keys in a cell, is what looking at
// one after the other says.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "engine/base/rng.h"
#include "lod/builder/points/inside.h"
#include "lod/builder/points/lattice_box.h"
#include "lod/builder/points/sorted_keys.h"

namespace stipple::lod {
namespace {

TEST(Inside, IsWhatLookingAtEachSays) {
    Rng rng(32);
    constexpr uint32_t kMost = UINT32_MAX;
    size_t all = 0, none = 0, inverted = 0;
    for (int round = 0; round < 4000; ++round) {
        const auto count = static_cast<size_t>(rng.uniform(0, 700)), begin = std::min<size_t>(count, rng.below(20));
        std::array<std::vector<uint32_t>, 3> place;
        // Few different ones, all there are, and both ends of what 32 bits hold.
        const auto any = [&]() -> uint32_t {
            switch (round % 3) {
                case 0:
                    return static_cast<uint32_t>(rng.below(12));
                case 1:
                    return static_cast<uint32_t>(rng.below(uint64_t{1} << 32));
                default:
                    return rng.below(2) == 0 ? static_cast<uint32_t>(rng.below(9))
                                             : kMost - static_cast<uint32_t>(rng.below(9));
            }
        };
        for (auto& column : place)
            for (size_t k = 0; k < count; ++k) column.push_back(any());
        LatticeBox box;
        for (size_t a = 0; a < 3; ++a) {
            const int64_t from = any(), to = any();
            box.lo[a] = std::min(from, to) - (rng.below(4) == 0 ? int64_t{1} << 33 : 0);
            box.hi[a] = std::max(from, to) + (rng.below(4) == 0 ? int64_t{1} << 33 : 0);
            // (What holds nothing: beside all of them, and turned inside out.)
            if (rng.below(30) == 0) box.lo[a] = box.hi[a] = rng.below(2) == 0 ? -5 : int64_t{1} << 34;
            if (rng.below(30) == 0) std::swap(box.lo[a], box.hi[a]);
            inverted += box.lo[a] > box.hi[a] ? 1 : 0;
        }
        std::vector<size_t> expected, found;
        for (size_t i = begin; i < count; ++i)
            if (box.holds(place[0][i], place[1][i], place[2][i])) expected.push_back(i);
        forInside({place[0].data(), place[1].data(), place[2].data()}, begin, count, box,
                  [&](size_t i) { found.push_back(i); });
        ASSERT_EQ(found, expected) << "round " << round;
        all += expected.size();
        none += expected.empty() ? 1 : 0;
    }
    EXPECT_GT(all, 50'000u);
    EXPECT_GT(none, 500u);
    EXPECT_GT(inverted, 200u);
}

template <typename K>
void expectRanges(uint64_t seed, int bits) {
    Rng rng(seed);
    for (int round = 0; round < 60; ++round) {
        // Clumps far apart, as surfaces have them; sometimes one key, or none.
        std::vector<Key> keys;
        const auto clumps = rng.below(5);
        for (uint64_t c = 0; c < clumps; ++c) {
            const Key at = static_cast<Key>(rng.below(uint64_t{1} << 62)) << (bits - 62);
            const auto shift = round % 4 == 0 ? 0 : rng.below(30);  // (all equal)
            const auto count = round % 3 == 0 ? 1 : rng.below(4000);
            for (uint64_t k = 0; k < count; ++k) keys.push_back(at + static_cast<Key>(rng.below(1u << shift)));
        }
        std::sort(keys.begin(), keys.end());
        const SortedKeys<K> sorted{keys};
        ASSERT_EQ(sorted.all().size(), keys.size());
        for (int k = 0; k < 3000; ++k) {
            const auto shift = static_cast<uint32_t>(rng.below(static_cast<uint64_t>(bits) + 1));
            // Beside one that is there, or anywhere.
            K key = static_cast<K>(rng.below(uint64_t{1} << 62)) << (bits - 62);
            if (!keys.empty() && k % 4 != 0)
                key = static_cast<K>(keys[rng.below(keys.size())]) + static_cast<K>(rng.below(3)) - 1;
            const K lo = key >> shift << shift, last = lo | ((K{1} << shift) - 1);
            const auto first = std::lower_bound(sorted.all().begin(), sorted.all().end(), lo),
                       end = std::upper_bound(first, sorted.all().end(), last);
            const KeyRange range = sorted.range(key, shift);
            ASSERT_EQ(range.second - range.first, static_cast<size_t>(end - first)) << round << ", shift " << shift;
            if (first != end) ASSERT_EQ(range.first, static_cast<size_t>(first - sorted.all().begin()));
        }
    }
}

TEST(SortedKeys, RangesAreThoseOfASearchAmongAll) {
    expectRanges<uint64_t>(33, 63);
    expectRanges<Key>(34, 96);
}

}  // namespace
}  // namespace stipple::lod
