// Measures of pictures on what is known beforehand.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/glm.hpp>

#include "apps/study/metrics/flip.h"
#include "apps/study/metrics/masks.h"
#include "apps/study/metrics/ssim.h"
#include "apps/study/sweep/errors.h"
#include "engine/base/rng.h"

namespace stipple {
namespace {

render::Image filled(uint32_t width, uint32_t height, uint32_t rgba) {
    render::Image image;
    image.width = width;
    image.height = height;
    image.rgba.assign(size_t{width} * height, rgba);
    return image;
}

double meanOf(const study::Plane& plane) {
    double sum = 0;
    for (const float v : plane.values) sum += v;
    return sum / static_cast<double>(plane.values.size());
}

double flipOf(uint32_t a, uint32_t b) {
    const auto seen = study::flip(filled(40, 30, a), filled(40, 30, b));
    EXPECT_TRUE(seen);
    return meanOf(*seen);
}

// By hand from the paper's formulas: plain colours have no features and filters leave them as they are. Green and blue
// are farthest apart, the 0.7th power of their distance is 41.275. Black and white are 100 apart (L* alone):
// 100^0.7 = 25.119 is above 0.4 * 41.275, so that 0.95 + (25.119 - 16.510) / (41.275 - 16.510) * 0.05. Grey 118 and
// 119 are 0.3974 apart: 0.3974^0.7 * 0.95 / 16.510.
TEST(StudyMetrics, FlipOfPlainColoursIsWhatThePaperSays) {
    EXPECT_NEAR(flipOf(0xff000000, 0xffffffff), 0.96738, 0.0002);
    EXPECT_NEAR(flipOf(0xff00ff00, 0xffff0000), 1.0, 1e-4) << "green and blue are farthest apart";
    EXPECT_EQ(flipOf(0xff204060, 0xff204060), 0);
    EXPECT_NEAR(flipOf(0xff767676, 0xff777777), 0.03016, 0.0002);
    EXPECT_EQ(flipOf(0xff767676, 0xff777777), flipOf(0xff777777, 0xff767676));
}

// The same mean error is seen less where it is too fine to be seen, and a lost edge is seen where it was.
TEST(StudyMetrics, FlipKnowsDistancesAndEdges) {
    render::Image checker = filled(64, 64, 0xff808080), edge = checker, ramp = checker;
    const render::Image plain = checker;
    for (uint32_t y = 0; y < 64; ++y)
        for (uint32_t x = 0; x < 64; ++x) {
            checker.rgba[64 * y + x] = (x + y) % 2 == 0 ? 0xff707070u : 0xff909090u;
            edge.rgba[64 * y + x] = x < 32 ? 0xff707070u : 0xff909090u;
            ramp.rgba[64 * y + x] = 0xff000000u | 0x010101u * (x < 24 ? 0x70u : x < 40 ? 0x70u + 2 * (x - 24) : 0x90u);
        }
    const double near = meanOf(*study::flip(checker, plain, 20)), far = meanOf(*study::flip(checker, plain, 140));
    EXPECT_LT(far, near);
    const study::Plane seen = *study::flip(ramp, edge);
    EXPECT_GT(seen.values[64 * 32 + 34], 0.1);
    EXPECT_LT(seen.values[64 * 32 + 4], 1e-4);
    EXPECT_FALSE(study::flip(plain, filled(64, 63, 0)));
}

TEST(StudyMetrics, SsimIsOneOfEqualPicturesAndTheFormulaOfPlainOnes) {
    Rng rng(3);
    render::Image noise = filled(48, 40, 0);
    for (uint32_t& c : noise.rgba) c = static_cast<uint32_t>(rng.next()) | 0xff000000u;
    EXPECT_NEAR(*study::ssim(noise, noise), 1, 1e-6);
    // Plain pictures: (2 a b + C1) / (a a + b b + C1).
    const double c1 = 0.01 * 255 * 0.01 * 255;
    EXPECT_NEAR(*study::ssim(filled(48, 40, 0xff646464), filled(48, 40, 0xff969696)),
                (2 * 100 * 150 + c1) / (100 * 100 + 150 * 150 + c1), 1e-3);
    render::Image shuffled = noise;
    for (uint32_t& c : shuffled.rgba) c = static_cast<uint32_t>(rng.next()) | 0xff000000u;
    EXPECT_LT(*study::ssim(noise, shuffled), 0.1) << "the control";
    EXPECT_FALSE(study::ssim(noise, filled(48, 41, 0)));
}

/// A square of `edge` pixels with depth and a normal, from (x, y).
render::Image square(uint32_t x, uint32_t y, uint32_t edge, float depth, const glm::vec3& normal) {
    render::Image image = filled(60, 50, 0);
    image.depth.assign(image.rgba.size(), 0);
    image.normal.assign(3 * image.rgba.size(), 0);
    for (uint32_t v = y; v < y + edge; ++v)
        for (uint32_t u = x; u < x + edge; ++u) {
            const size_t i = size_t{v} * 60 + u;
            image.rgba[i] = 0xff808080u;
            image.depth[i] = depth;
            for (size_t k = 0; k < 3; ++k) image.normal[3 * i + k] = normal[static_cast<int>(k)];
        }
    return image;
}

TEST(StudyMetrics, MasksOfMovedSquares) {
    const render::Image here = square(10, 10, 20, 2, {0, 0, 1});
    const auto same = study::compareMasks(here, here);
    EXPECT_EQ(same.overlap, 1);
    EXPECT_EQ(same.boundaryPixels, 0);
    EXPECT_EQ(same.holes + same.spill, 0u);
    EXPECT_EQ(same.depthRmse, 0);
    EXPECT_EQ(same.normalMean, 0);
    // Moved by 2 of 20 pixels, 1 % deeper, turned by 3 degrees.
    const double a = 3 * 0.017453292519943295;
    const auto moved = study::compareMasks(
        square(12, 10, 20, 2.02f, {static_cast<float>(std::sin(a)), 0, static_cast<float>(std::cos(a))}), here);
    EXPECT_NEAR(moved.overlap, 18.0 / 22, 1e-12);
    // Of 76 boundary pixels of the left one: 20 at the left 2 px away; of the right side 16 are 2 px and two 1 px away;
    // one of the top and of the bottom are 1 px away, the others on the other's boundary: 76 px in all, and mirrored.
    EXPECT_NEAR(moved.boundaryPixels, 1, 1e-9);
    EXPECT_NEAR(moved.depthRmse, 0.01, 1e-6);
    EXPECT_NEAR(moved.depthP99, 0.01, 1e-6);
    EXPECT_NEAR(moved.normalMean, 3, 1e-4);
    EXPECT_NEAR(moved.normalP95, 3, 1e-4);
    // One pixel of the inside is missing; another one lies far outside.
    render::Image broken = here;
    broken.rgba[60 * 20 + 20] = 0;
    broken.rgba[60 * 44 + 50] = 0xffffffffu;
    const auto holed = study::compareMasks(broken, here);
    EXPECT_EQ(holed.holes, 1u);
    EXPECT_EQ(holed.spill, 1u);
    EXPECT_TRUE(std::isnan(study::compareMasks(filled(60, 50, 0), here).boundaryPixels));
}

TEST(Pops, AreWhatChangesOfCoveredPixelsAndNotOfTheBackground) {
    render::Image frame;
    frame.width = 100;
    frame.height = 100;
    frame.rgba.assign(10'000, 0xff404040u);
    frame.depth.assign(10'000, 1.0f);
    for (size_t i = 0; i < 5'000; ++i) frame.depth[i] = 0;
    render::Image next = frame;
    EXPECT_EQ(study::popOf(frame, next).most, 0);
    for (size_t i = 0; i < 1'000; ++i) next.rgba[i] = 0xffffffffu;  // background on both sides
    EXPECT_EQ(study::popOf(frame, next).most, 0);
    for (size_t i = 9'000; i < 9'004; ++i) next.rgba[i] = 0xff40404fu;
    EXPECT_EQ(study::popOf(frame, next).most, 15);
    EXPECT_EQ(study::popOf(frame, next).p999, 0) << "four of 5,000 are fewer than one in a thousand";
    for (size_t i = 9'000; i < 9'010; ++i) next.rgba[i] = 0xff400040u;
    EXPECT_EQ(study::popOf(frame, next).p999, 64);
}

}  // namespace
}  // namespace stipple
