// Where the frames of an accumulated picture look: evenly in the pixel, on the lens and in time; and what a thin lens
// keeps sharp.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "engine/render/sampling.h"

namespace stipple::render {
namespace {

using glm::dvec2;
using glm::dvec3;

TEST(Sampling, EveryPowerOfTwoOfSamplesIsEvenInEveryDimension) {
    for (uint32_t k = 0; k <= 10; ++k)
        for (uint32_t block = 0; block < 3; ++block) {
            const uint32_t count = 1u << k;
            std::vector<std::array<double, 6>> u;
            for (uint32_t i = 0; i < count; ++i) u.push_back(lowDiscrepancy(block * count + i));
            for (size_t d = 0; d < 6; ++d) {
                std::set<uint32_t> cells;
                for (const auto& p : u) cells.insert(static_cast<uint32_t>(p.at(d) * count));
                EXPECT_EQ(cells.size(), count) << "dimension " << d << ", " << count << " from " << block * count;
            }
            // Boxes of the pixel of any shape: 2^a across, 2^(k-a) down.
            for (uint32_t a = 0; a <= k; ++a) {
                std::set<std::pair<uint32_t, uint32_t>> boxes;
                for (const auto& p : u)
                    boxes.emplace(static_cast<uint32_t>(p[0] * (1u << a)),
                                  static_cast<uint32_t>(p[1] * (1u << (k - a))));
                EXPECT_EQ(boxes.size(), count) << "boxes of " << (1u << a) << " columns";
            }
        }
}

TEST(Sampling, PixelsLensesAndExposuresAreFilledAroundTheirMiddle) {
    constexpr uint32_t kCount = 1024;
    dvec2 pixel(0), lens(0);
    double lensSquared = 0, time = 0;
    std::array<int, 4> quadrants{};
    for (uint32_t i = 0; i < kCount; ++i) {
        const FrameSample s = sampleOf(i);
        EXPECT_LE(glm::length(s.lens), 1.0);
        EXPECT_LT(std::max({std::abs(s.pixel.x), std::abs(s.pixel.y), std::abs(s.time)}), 0.5);
        pixel += s.pixel;
        lens += s.lens;
        lensSquared += glm::dot(s.lens, s.lens);
        time += s.time;
        ++quadrants.at((s.lens.x > 0 ? 1 : 0) + (s.lens.y > 0 ? 2 : 0));
    }
    // One sample in each of 1,024 intervals: means are off by a thousandth at most.
    EXPECT_LT(glm::length(pixel) / kCount, 1.5e-3);
    EXPECT_LT(std::abs(time) / kCount, 1e-3);
    EXPECT_LT(glm::length(lens) / kCount, 1e-2);
    EXPECT_NEAR(lensSquared / kCount, 0.5, 5e-3) << "evenly by area: the mean of r^2";
    for (const int q : quadrants) EXPECT_NEAR(q, kCount / 4.0, 4);
}

dvec2 imageOf(const lod::View& v, const dvec3& world) {
    const dvec3 d = world - v.eye;
    const double scale = v.focalPixels / (v.isOrthographic ? 1 : glm::dot(d, v.forward));
    return scale * dvec2(glm::dot(d, v.right), glm::dot(d, v.down)) + v.principal();
}

TEST(Sampling, ALensKeepsThePlaneInFocusAndMovesTheRestWithinItsCircle) {
    lod::View view;
    view.eye = {1, 2, 3};
    const Lens lens{0.25, 7};
    for (const double depth : {2.0, 5.0, 7.0, 11.0, 400.0}) {
        const double circle = circleOfConfusion(view, lens, depth);
        if (depth == 7) {
            EXPECT_EQ(circle, 0);
        } else {
            EXPECT_GT(circle, 1);
        }
        double widest = 0;
        for (uint32_t i = 0; i < 1024; ++i) {
            FrameSample s = sampleOf(i);
            s.pixel = dvec2(0);
            const dvec3 place = view.eye + depth * (view.forward + 0.2 * view.right - 0.1 * view.down);
            const double off = glm::length(imageOf(viewOf(view, s, lens), place) - imageOf(view, place));
            EXPECT_LE(off, 0.5 * circle + 1e-9) << "depth " << depth;
            widest = std::max(widest, off);
        }
        EXPECT_GE(widest, 0.98 * 0.5 * circle) << "depth " << depth;
    }
}

TEST(Sampling, APixelIsMovedAsItSaysAndAPinholeHasNoLens) {
    lod::View view;
    for (const bool isOrthographic : {false, true}) {
        view.isOrthographic = isOrthographic;
        const FrameSample s{{0.25, -0.4}, {0.3, 0.9}, 0.1};
        const dvec3 place = view.eye + 5.0 * view.forward;
        const dvec2 off = imageOf(viewOf(view, s, {}), place) - imageOf(view, place);
        EXPECT_NEAR(off.x, -0.25, 1e-12);
        EXPECT_NEAR(off.y, 0.4, 1e-12);
        EXPECT_EQ(viewOf(view, s, {}).eye, view.eye);
    }
    EXPECT_EQ(circleOfConfusion(view, {}, 3), 0);
}

}  // namespace
}  // namespace stipple::render
