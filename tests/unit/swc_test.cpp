// Neurons of odd shapes: reading takes as long as there are samples.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>

#include "lod/import/curves/curve_readers.h"
#include "tests/support/runs.h"

namespace stipple::lod {
namespace {

TEST(Swc, AStarIsReadInOneGo) {
    constexpr int kArms = 200'000;
    std::string text = "1 1 0 0 0 1 -1\n";
    for (int i = 0; i < kArms; ++i) text += fmt::format("{} 3 {} {} 1 0.1 1\n", i + 2, i % 97, i % 89);
    const auto start = std::chrono::steady_clock::now();
    const auto star = readSwc(text, "star.swc");
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    ASSERT_TRUE(star);
    EXPECT_EQ(star->curves(), kArms + 1u) << "and the ball in the middle";
    EXPECT_EQ(star->position.size(), 2 * (kArms + 1u));
    EXPECT_FLOAT_EQ(star->radius[2], 0.1f) << "arms do not begin with the radius of the middle";
    EXPECT_LT(seconds.count(), 5 * test::kSlower) << "each arm looks at all others";
}

}  // namespace
}  // namespace stipple::lod
