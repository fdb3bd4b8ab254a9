// Visibility keys sort as (depth, kind, block, lane) do, and give all of it back. The oracle compares tuples.
#include "shaders/shared/visibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <vector>

#include "engine/base/rng.h"

namespace stipple {
namespace {

struct Shown {
    float depth;
    uint32_t kind, block, lane;  ///< block: of its kind
};

struct Case {
    std::array<uint32_t, 4> blocks;  ///< points, curves, triangles, patches
    shared::BlockRanges first() const { return {{0, firstOf(1), firstOf(2), firstOf(3), firstOf(4)}}; }
    uint32_t firstOf(uint32_t kind) const {
        uint32_t sum = 0;
        for (uint32_t k = 0; k < std::min(kind, 4u); ++k) sum += blocks.at(k);
        return sum;
    }
    uint64_t keyOf(const Shown& s) const {
        return shared::visibilityKey(shared::floatBitsToUint(s.depth),
                                     shared::drawId(firstOf(s.kind), 256 * s.block + s.lane));
    }
};

// Frames of one kind, of all, and as many blocks as there may be: their ids need all 33 bits.
const std::vector<Case> kCases{{{5, 0, 0, 0}},
                               {{0, 3, 0, 0}},
                               {{0, 0, 7, 0}},
                               {{0, 0, 0, 4}},
                               {{3, 1, 2, 5}},
                               {{1000, 2000, 3000, 4000}},
                               {{1u << 23, 1u << 22, 1u << 22, (1u << 23) - 1}},
                               {{0, 0, (1u << 24) - 1, (1u << 24) - 1}}};

std::vector<Shown> someOf(const Case& c, Rng& rng) {
    std::vector<Shown> all;
    const std::array<float, 7> depths{
        std::numeric_limits<float>::denorm_min(), 1e-30f, 1.0f, std::nextafter(1.0f, 2.0f), 7.5f, 3e38f,
        std::numeric_limits<float>::infinity()};
    for (uint32_t kind = 0; kind < 5; ++kind) {
        const uint32_t blocks = c.blocks.at(kind == shared::kKindDiscs ? 0 : kind);
        for (int k = 0; k < 60 && blocks > 0; ++k) {
            const uint32_t block = k == 0 ? 0 : k == 1 ? blocks - 1 : static_cast<uint32_t>(rng.next() % blocks);
            const auto lane = static_cast<uint32_t>(k < 2 ? 255 * k : rng.next() % 256);
            all.push_back({depths.at(rng.next() % depths.size()), kind, block, lane});
        }
    }
    return all;
}

TEST(VisibilityKey, SortsByDepthThenKindThenBlockThenLane) {
    Rng rng(1);
    for (const Case& c : kCases) {
        const std::vector<Shown> all = someOf(c, rng);
        for (const Shown& a : all)
            for (const Shown& b : all)
                ASSERT_EQ(c.keyOf(a) < c.keyOf(b),
                          std::tie(a.depth, a.kind, a.block, a.lane) < std::tie(b.depth, b.kind, b.block, b.lane))
                    << a.depth << ' ' << a.kind << ' ' << a.block << ' ' << a.lane << " against " << b.depth << ' '
                    << b.kind << ' ' << b.block << ' ' << b.lane;
    }
}

TEST(VisibilityKey, GivesBackWhatItWasMadeOf) {
    Rng rng(2);
    for (const Case& c : kCases)
        for (const Shown& s : someOf(c, rng)) {
            const uint64_t key = c.keyOf(s);
            EXPECT_EQ(shared::keyDepth(key), s.depth);
            EXPECT_EQ(shared::keyKind(key, c.first()), s.kind);
            EXPECT_EQ(shared::isPointKey(key, c.first()), s.kind == shared::kKindPoints);
            EXPECT_EQ(shared::keyBlock(key) - c.firstOf(s.kind), s.block);
            EXPECT_EQ(shared::keyLane(key), s.lane);
            EXPECT_EQ(shared::keyPlace(key, c.firstOf(s.kind)), 256 * s.block + s.lane);
        }
}

TEST(VisibilityKey, NothingIsBehindEverything) {
    Rng rng(3);
    for (const Case& c : kCases) {
        EXPECT_EQ(shared::keyKind(shared::kNoKey, c.first()), shared::kKindNothing);
        EXPECT_FALSE(shared::isPointKey(shared::kNoKey, c.first()));
        for (const Shown& s : someOf(c, rng)) EXPECT_LT(c.keyOf(s), shared::kNoKey);
    }
}

}  // namespace
}  // namespace stipple
