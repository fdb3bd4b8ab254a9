// Bytes of many threads in one region, and its pages, which go back when nobody needs them.
#include "engine/base/spill.h"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <thread>

namespace stipple {
namespace {

constexpr uint64_t kHuge = uint64_t{2} << 20;

TEST(HugeRegion, PartsLieApartAndAreWhole) {
    const std::array<uint64_t, 5> sizes{0, 1, 3 * kHuge + 5, 63, 70};
    const HugeRegion region(sizes);
    for (size_t i = 0; i < sizes.size(); ++i) {
        ASSERT_EQ(region.part(i).size(), sizes.at(i));
        std::memset(region.part(i).data(), static_cast<int>(i + 1), sizes.at(i));
    }
    for (size_t i = 0; i < sizes.size(); ++i)
        for (const uint8_t v : region.part(i)) ASSERT_EQ(v, i + 1);
}

TEST(HugeRegion, APageGoesWhenItsLastPartGoes) {
    // The first and the second share page 1, the second and the third page 2; an anonymous page that went reads as
    // zero.
    // (The last part, which stays, keeps the region itself.)
    HugeRegion region(std::array<uint64_t, 4>{kHuge + kHuge / 2, kHuge, 100, 2 * kHuge});
    for (size_t i = 0; i < 4; ++i) std::memset(region.part(i).data(), 7, region.part(i).size());
    const std::span<uint8_t> first = region.part(0), second = region.part(1), third = region.part(2);
    region.release(0);
    EXPECT_EQ(first.front(), 0);
    EXPECT_EQ(first.back(), 7) << "the page is its neighbour's, too";
    region.release(2);
    EXPECT_EQ(third.front(), 7);
    EXPECT_EQ(second.front(), 7);
    region.release(1);
    EXPECT_EQ(second.front(), 0);
    EXPECT_EQ(third.front(), 7) << "beside the fourth";
    EXPECT_EQ(region.part(3).back(), 7);
    EXPECT_EQ(first.back(), 0);
}

TEST(HugeRegion, OfNothingHasEmptyParts) {
    HugeRegion region(std::array<uint64_t, 2>{0, 0});
    EXPECT_TRUE(region.part(0).empty());
    region.release(0);
    region.release(1);
}

TEST(Spill, ThreadsAppendToTheirPlacesOfARegion) {
    constexpr size_t kThreads = 4, kTimes = 5000;
    HugeRegion region(std::array<uint64_t, 2>{kThreads * kTimes * 8, 64});
    Spill spill("");
    spill.placeIn(region, 0);
    std::memset(region.part(1).data(), 0xee, 64);
    std::vector<std::thread> threads;
    for (size_t t = 0; t < kThreads; ++t)
        threads.emplace_back([&spill, t] {
            for (size_t k = 0; k < kTimes; ++k) {
                const uint64_t value = t * kTimes + k;
                std::array<uint8_t, 8> bytes{};
                std::memcpy(bytes.data(), &value, 8);
                EXPECT_TRUE(spill.append(bytes));
            }
        });
    for (std::thread& t : threads) t.join();
    std::vector<uint8_t> held;
    const auto bytes = spill.look(held);
    ASSERT_TRUE(bytes);
    ASSERT_EQ(bytes->size(), kThreads * kTimes * 8);
    std::vector<bool> has(kThreads * kTimes);
    for (size_t i = 0; i < has.size(); ++i) {
        uint64_t value = 0;
        std::memcpy(&value, bytes->data() + 8 * i, 8);
        ASSERT_LT(value, has.size());
        EXPECT_FALSE(has[value]) << "twice";
        has[value] = true;
    }
    const auto part = spill.part(16, 8);
    ASSERT_TRUE(part);
    EXPECT_EQ(std::memcmp(part->data(), bytes->data() + 16, 8), 0);
    // What is more than was said is refused, and nothing is written behind the place.
    EXPECT_FALSE(spill.append(std::array<uint8_t, 1>{1}));
    for (const uint8_t v : region.part(1)) EXPECT_EQ(v, 0xee);
    EXPECT_EQ(spill.bytes(), bytes->size());
}

TEST(Spill, WhatIsTakenOutOfARegionIsTheCallers) {
    HugeRegion region(std::array<uint64_t, 2>{kHuge, 1});
    Spill spill("");
    spill.placeIn(region, 0);
    ASSERT_TRUE(spill.append(std::array<uint8_t, 3>{1, 2, 3}));
    const auto taken = spill.take();
    ASSERT_TRUE(taken);
    EXPECT_EQ(*taken, (std::vector<uint8_t>{1, 2, 3}));
    EXPECT_EQ(region.part(0)[0], 0);
}

}  // namespace
}  // namespace stipple
