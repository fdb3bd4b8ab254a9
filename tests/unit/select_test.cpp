// The value at a rank: what sorting would say, whatever the guess.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "engine/base/lanes.h"
#include "lod/builder/points/select.h"
#include "tests/support/support.h"

namespace stipple::lod {
namespace {

TEST(Select, IsWhatSortingSays) {
    Rng rng(12);
    for (int round = 0; round < 20'000; ++round) {
        const auto count = static_cast<size_t>(rng.uniform(1, 90));
        const int kind = round % 5;
        std::vector<float> values;
        for (size_t i = 0; i < count; ++i) {
            const double v = rng.uniform();
            // Spread evenly; few different ones; mostly zero; over many orders of magnitude; all equal.
            values.push_back(static_cast<float>(kind == 0   ? v
                                                : kind == 1 ? std::floor(4 * v)
                                                : kind == 2 ? (v < 0.8 ? 0.0 : v)
                                                : kind == 3 ? std::exp2(60 * v - 30)
                                                            : 0.25));
        }
        std::vector<int32_t> bits;
        for (const float v : values) bits.push_back(std::bit_cast<int32_t>(v));
        while (bits.size() % kLanes != 0) bits.push_back(kNothing);
        std::sort(values.begin(), values.end());
        const auto rank = static_cast<size_t>(rng.uniform() * 0.9999 * static_cast<double>(count));
        for (const float guess : {0.0f, values[rank], 0.5f * values[rank], 2 * values[rank], 1e30f, 1e-30f})
            ASSERT_EQ(smallestAtRank(bits.data(), count, rank, guess), values[rank])
                << "rank " << rank << " of " << count << ", kind " << kind << ", guess " << guess;
    }
}

TEST(Select, DistancesFillWholeVectors) {
    const std::vector<float> x{1, 2, 3}, y{0, 0, 1}, z{0, 5, 1};
    std::vector<int32_t> out(kLanes, 7);
    squaredDistances(x.data(), y.data(), z.data(), 3, {1, 0, 0}, out.data());
    EXPECT_EQ(std::bit_cast<float>(out[0]), 0);
    EXPECT_EQ(std::bit_cast<float>(out[1]), 26);
    EXPECT_EQ(std::bit_cast<float>(out[2]), 6);
    for (size_t k = 3; k < kLanes; ++k) EXPECT_EQ(out[k], kNothing);
}

}  // namespace
}  // namespace stipple::lod
