// Pictures that are means of frames: what they come to, how fast, and that depth of field and motion blur are those of
// a thin lens and of a moving camera, in closed form.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/reference/reference.h"
#include "engine/render/accumulation.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"
#include "tests/support/mixed_store.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;
using render::FrameSettings;
using render::Image;

class Accumulated : public test::BackendsHere {
  protected:
    using Stores = std::vector<std::shared_ptr<const lod::Store>>;

    /// The mean of the frames of an exposure, and nothing else, by the usual backend.
    Image exposed(const Stores& stores, const render::ViewAfter& after, const FrameSettings& settings,
                  const render::Exposure& exposure) {
        const auto state = render::makeFrameState(stores, usual(), *executor_, {});
        FrameSettings first = settings;
        first.wantDepthAndNormal = true;
        EXPECT_TRUE(render::renderUntilComplete(*state, after(0), first));
        const auto draw = [&](const lod::View& view, const FrameSettings& s) -> Result<void> {
            STIPPLE_TRY(render::renderUntilComplete(*state, view, s));
            return {};
        };
        EXPECT_TRUE(render::expose(exposure, after, settings, draw, state->image, *executor_));
        return state->image;
    }
    Image exposed(const Stores& stores, const lod::View& view, const FrameSettings& settings, uint32_t samples) {
        return exposed(stores, [&](double) { return view; }, settings, {samples, {}, 0});
    }
    /// The mean of n x n frames, one anywhere in each cell of a grid of the pixel.
    Image onGrid(const Stores& stores, const lod::View& view, const FrameSettings& settings, int n) {
        const auto state = render::makeFrameState(stores, usual(), *executor_, {});
        render::Accumulation sum;
        Rng rng(7);
        for (int i = 0; i < n * n; ++i) {
            lod::View moved = view;
            moved.shift = {(i % n + rng.uniform()) / n - 0.5, (i / n + rng.uniform()) / n - 0.5};
            FrameSettings s = settings;
            s.wantDepthAndNormal = true;
            s.draw.coverageSeed = static_cast<uint32_t>(i);
            EXPECT_TRUE(render::renderUntilComplete(*state, moved, s));
            sum.add(state->image, *executor_);
        }
        Image mean;
        sum.mean(mean, *executor_);
        return mean;
    }
    static double rms(const Image& a, const Image& b) {
        EXPECT_EQ(a.linear.size(), b.linear.size());
        double sum = 0;
        for (size_t i = 0; i < a.linear.size(); ++i) sum += std::pow(double(a.linear[i]) - b.linear[i], 2);
        return std::sqrt(sum / static_cast<double>(a.linear.size()));
    }
};

TEST_F(Accumulated, PicturesConvergeToTheMeanOf4096FramesOfTheirMode) {
    test::writeMixedStore(folder_ / "m.stipple");
    auto mixed = lod::openStore(folder_ / "m.stipple");
    ASSERT_TRUE(mixed);
    const Stores stores{std::make_shared<const lod::Store>(std::move(*mixed))};
    const lod::View view = test::fitView(*stores.front(), 48, 36);
    const FrameSettings settings = test::drawnAs(render::Mode::surface);
    const Image truth = onGrid(stores, view, settings, 64);
    std::string figures;
    double before = rms(exposed(stores, view, settings, 1), truth);
    const double plain = before;
    for (const uint32_t n : {4u, 16u, 64u, 256u}) {
        const double error = rms(exposed(stores, view, settings, n), truth);
        figures += fmt::format(" {}: {:.5f}", n, error);
        // Frames at random places would halve it each time; the truth is off by a part of that, too.
        EXPECT_LT(error, (n <= 64 ? 0.5 : 0.7) * before) << n << " frames";
        before = error;
    }
    RecordProperty("rms", figures);
    fmt::print("rms of 1: {:.5f}{}\n", plain, figures);
}

/// Where the light of a picture is: its sum, its middle and its variance along each axis, px and px^2, and how far
/// from the middle the farthest lit pixel is.
struct Spread {
    double light = 0, farthest = 0;
    dvec2 middle{0}, variance{0};
};
Spread spreadOf(const Image& image) {
    Spread s;
    const auto forLit = [&](const auto& each) {
        for (size_t i = 0; i < image.rgba.size(); ++i)
            if (image.linear[3 * i] > 1e-4f)
                each(dvec2(double(i % image.width) + 0.5, double(i / image.width) + 0.5), double(image.linear[3 * i]));
    };
    forLit([&](const dvec2& p, double light) {
        s.light += light;
        s.middle += light * p;
    });
    s.middle /= s.light;
    forLit([&](const dvec2& p, double light) {
        s.variance += light / s.light * (p - s.middle) * (p - s.middle);
        s.farthest = std::max(s.farthest, glm::length(p - s.middle));
    });
    return s;
}

/// A white disc of 3 px across before black, 20 units away, that faces the eye.
class OfOneDisc : public Accumulated {
  protected:
    void SetUp() override {
        Accumulated::SetUp();
        view_.width = view_.height = 96;
        view_.focalPixels = 200;
        view_.eye = {0, 0, kDepth};
        std::vector<test::TestPoint> points;
        for (int y = -5; y <= 5; ++y)
            for (int x = -5; x <= 5; ++x)
                if (x * x + y * y <= 25) points.push_back({dvec3(0.03 * x, 0.03 * y, 0), {0, 0, 1}, 0xffffff});
        test::writePly(folder_ / "a.ply", points);
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        settings_ = test::drawnAs(render::Mode::splat, 1e-4, false);
        settings_.draw.background = glm::vec3(0);
    }
    Spread spread(const render::Exposure& exposure, const dvec3& velocity = dvec3(0)) {
        const auto after = [&](double seconds) {
            lod::View v = view_;
            v.eye += seconds * velocity;
            return v;
        };
        return spreadOf(exposed({store_}, after, settings_, exposure));
    }
    static constexpr double kDepth = 20;
    lod::View view_;
    std::shared_ptr<const lod::Store> store_;
    FrameSettings settings_;
};

TEST_F(OfOneDisc, OutOfFocusItIsACircleOfConfusion) {
    const render::Lens sharp{2, kDepth};
    const Spread own = spread({256, sharp, 0});
    EXPECT_LT(own.farthest, 1.5 + 2) << "in focus it is as large as without a lens";
    for (const double focus : {10.0, 14.0, 60.0}) {
        const render::Lens lens{2, focus};
        // F A |1/focus - 1/depth|: 20, 8.6 and 13.3 px. Along each axis a disc of that width has the variance C^2 / 16.
        const double circle = 200 * 2 * std::abs(1 / focus - 1 / kDepth);
        EXPECT_NEAR(render::circleOfConfusion(view_, lens, kDepth), circle, 1e-9);
        const Spread blurred = spread({256, lens, 0});
        EXPECT_LT(blurred.farthest, 0.5 * circle + own.farthest + 0.5);
        EXPECT_NEAR(blurred.light, own.light, 0.01 * own.light) << "no light is lost";
        EXPECT_LT(glm::length(blurred.middle - own.middle), 0.02 * circle);
    }
}

TEST_F(OfOneDisc, AMovingCameraDrawsAStreakAsLongAsItsWay) {
    const Spread own = spread({256, {}, 0});
    for (const double shutter : {0.25, 0.5}) {
        // F v t / depth = 200 * 8 * t / 20 px; of an even streak the variance is L^2 / 12.
        const double length = 80 * shutter;
        const Spread moved = spread({256, {}, shutter}, {8, 0, 0});
        EXPECT_NEAR(std::sqrt(12 * (moved.variance.x - own.variance.x)), length, 0.01 * length) << shutter;
        EXPECT_NEAR(moved.variance.y, own.variance.y, 0.05);
        EXPECT_LT(moved.farthest, 0.5 * length + own.farthest + 0.5);
        EXPECT_LT(glm::length(moved.middle - own.middle), 0.01 * length) << "the exposure is about the moment";
        EXPECT_NEAR(moved.light, own.light, 0.01 * own.light);
    }
}

TEST_F(OfOneDisc, ShutAndWithoutALensNothingIsAnother) {
    const auto still = [&](double) { return view_; };
    const auto picture = [&](const render::Exposure& e) { return exposed({store_}, still, settings_, e); };
    // One frame is that frame, whatever is asked of the others.
    FrameSettings plain = settings_;
    plain.wantDepthAndNormal = true;
    const Image frame = test::renderView(store_, usual(), *executor_, view_, plain);
    const Image one = picture({1, {3, 5}, 2});
    EXPECT_TRUE(one.rgba == frame.rgba && one.linear == frame.linear && one.depth == frame.depth);
    // No aperture: the frames are those without a lens; no time: those of one moment.
    const Image some = picture({16, {}, 0});
    EXPECT_TRUE(picture({16, {0, 5}, 0}).linear == some.linear);
    EXPECT_FALSE(picture({16, {1, 5}, 0}).linear == some.linear);
    EXPECT_TRUE(some.depth == frame.depth) << "depths stay those of the frame";
    EXPECT_EQ(render::settingsOf(settings_, 7, {1, {}, 0}).draw.wind.seconds, settings_.draw.wind.seconds);
    EXPECT_NEAR(render::settingsOf(settings_, 7, {1, {}, 4}).draw.wind.seconds,
                settings_.draw.wind.seconds + 4 * render::sampleOf(7).time, 1e-12);
}

TEST(Accumulations, AreOfOneSizeAndShowNothingOfWhatIsNoNumber) {
    const auto executor = makeTbbExecutor(2);
    render::Accumulation sum;
    Image a;
    a.width = 2;
    a.height = 1;
    a.rgba = {0xff000000u, 0};
    a.linear = {0.25f, NAN, 4.0f, 0, 0, -1.0f};
    sum.add(a, *executor);
    a.linear = {0.75f, 1.0f, 0.0f, 0, 0, 0};
    sum.add(a, *executor);
    Image mean;
    mean.depth = {1, 2};
    sum.mean(mean, *executor);
    EXPECT_EQ(mean.linear, (std::vector<float>{0.5f, 0.5f, 0.5f, 0, 0, 0}));
    EXPECT_EQ(mean.rgba, (std::vector<uint32_t>{0xffbcbcbcu, 0}));
    EXPECT_EQ(mean.depth, (std::vector<float>{1, 2}));
    a.width = 1;
    a.rgba.resize(1);
    a.linear.resize(3);
    sum.add(a, *executor);
    EXPECT_EQ(sum.count(), 1u) << "pictures of another size begin anew";
}

}  // namespace
}  // namespace stipple
