// A thread that holds regions of the picture is alone there.
#include "engine/cpu/pixel_regions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <thread>
#include <vector>

namespace stipple::cpu {
namespace {

TEST(PixelRegions, NobodyElseWritesWhatIsHeld) {
    constexpr int kWidth = 700, kHeight = 300, kThreads = 4, kRounds = 4'000;
    PixelRegions regions;
    regions.resize(4'000, 3'000);
    regions.resize(kWidth, kHeight);                         // of a smaller picture
    std::vector<uint32_t> pixels(size_t{kWidth} * kHeight);  // added to without atomic operations
    std::vector<uint64_t> added(kThreads);
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
        threads.emplace_back([&, t] {
            std::mt19937 random(static_cast<uint32_t>(t + 1));
            const auto below = [&](int end) { return static_cast<int>(random() % static_cast<uint32_t>(end)); };
            for (int round = 0; round < kRounds; ++round) {
                const int x0 = below(kWidth), x1 = std::min(kWidth - 1, x0 + below(300));
                const int y0 = below(kHeight), y1 = std::min(kHeight - 1, y0 + below(150));
                const PixelRegions::Held held(regions, x0, x1, y0, y1);
                for (int k = 0; k < 64; ++k) {  // corners first, which others hold, too
                    const int x = k < 4 ? (k % 2 == 0 ? x0 : x1) : x0 + below(x1 - x0 + 1);
                    const int y = k < 4 ? (k / 2 == 0 ? y0 : y1) : y0 + below(y1 - y0 + 1);
                    ++pixels[static_cast<size_t>(y) * kWidth + static_cast<size_t>(x)];
                    ++added[static_cast<size_t>(t)];
                }
            }
        });
    }
    for (std::thread& thread : threads) thread.join();
    uint64_t sum = 0, expected = 0;
    for (const uint32_t p : pixels) sum += p;
    for (const uint64_t a : added) expected += a;
    EXPECT_EQ(sum, expected);
    EXPECT_EQ(expected, uint64_t{64} * kThreads * kRounds);
}

}  // namespace
}  // namespace stipple::cpu
