// Metered exposure: what a picture's mean becomes, whatever the light; on every backend.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/render/picture_tone.h"
#include "tests/support/backends_here.h"
#include "tests/support/effect_scenes.h"

namespace stipple::render {
namespace {

/// Pixels of one luminance each, covered in full.
Image pixels(const std::vector<float>& grey) {
    Image image;
    image.width = static_cast<uint32_t>(grey.size());
    image.height = 1;
    for (const float g : grey) {
        image.rgba.push_back(0xff000000u);
        image.linear.insert(image.linear.end(), {g, g, g});
    }
    return image;
}

TEST(Metering, TakesTheMeanOfLogarithmsToMiddleGrey) {
    EXPECT_NEAR(meteredExposure(pixels({0.02f, 0.02f}), {}), 9, 1e-5);
    EXPECT_NEAR(meteredExposure(pixels({0.01f, 1.0f}), {}), 1.8, 1e-5) << "(of the values themselves: 0.356)";
    Image image = pixels({0.5f, 0.25f, 7.0f});
    image.rgba[2] = 0;  // the background
    EXPECT_NEAR(meteredExposure(image, {}), 0.18 / std::sqrt(0.125), 1e-5);
    image.rgba[1] = 0x80000000u;  // half a surface of 0.4 over a background of 0.1
    for (size_t c = 3; c < 6; ++c) image.linear[c] = 0.1f + 128.0f / 255 * 0.3f;
    const double mean = (std::log(0.5) + 128.0 / 255 * std::log(0.4)) / (1 + 128.0 / 255);
    EXPECT_NEAR(meteredExposure(image, glm::vec3(0.1f)), 0.18 / std::exp(mean), 1e-4);
    EXPECT_EQ(meteredExposure(pixels({}), {}), 1);
    EXPECT_EQ(meteredExposure(pixels({0, 0}), {}), 0.18 * 0x1p20);
    EXPECT_EQ(meteredExposure(pixels({1e30f}), {}), 0x1p-20);
}

class MeteredPictures : public test::BackendsHere {};

TEST_F(MeteredPictures, AreTheSameWhateverTheLight) {
    const auto placed = test::effectStores(folder_.path(), *executor_);
    for (auto& [name, backend] : backends_) {
        const auto drawn = [&](float light, double metering) {
            FrameSettings s;
            s.draw.worldUp = {0, 1, 0};
            s.draw.lit = true;
            s.budgets.errorPixels = 2;
            s.draw.environment = std::make_shared<const Environment>(
                makeEnvironment({8, 4, std::vector<float>(96, 0.5f)}, light, *executor_));
            s.draw.effects = {"tone"};
            s.draw.parameters.tone = {1, 1, metering};
            s.draw.background = glm::vec3(0);
            return test::draw(placed, *backend, *executor_, test::effectView(160, 120), s);
        };
        const auto most = [](const Image& a, const Image& b) {
            int off = 0;
            for (size_t i = 0; i < a.rgba.size(); ++i)
                for (uint32_t shift = 0; shift < 24; shift += 8)
                    off = std::max(off, std::abs(int(a.rgba[i] >> shift & 255u) - int(b.rgba[i] >> shift & 255u)));
            return off;
        };
        EXPECT_LE(most(drawn(0.25f, 1), drawn(8, 1)), 1) << name;
        EXPECT_GT(most(drawn(0.25f, 0), drawn(8, 0)), 60) << name << ": the control";
    }
}

}  // namespace
}  // namespace stipple::render
