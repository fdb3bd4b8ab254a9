// Comparison variants: each shows the fault that its paper shows, where the mode beside it does not. They are the
// negative controls of what the modes promise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "engine/reference/variants/variants.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;
using render::Mode;

class Variants : public testing::Test {
  protected:
    std::shared_ptr<const lod::Store> storeOf(const std::vector<test::TestPoint>& points, bool withRadii = false) {
        test::writePly(folder_ / "a.ply", points, true, withRadii);
        return test::buildAndOpen(folder_ / "a.ply", folder_ / ("a" + std::to_string(++stores_)), *executor_);
    }
    render::Image draw(render::Backend& backend, const std::shared_ptr<const lod::Store>& store, const lod::View& view,
                       Mode mode, bool isLit = false) {
        render::FrameSettings settings;
        settings.mode = mode;
        settings.budgets.errorPixels = 1e-4;
        settings.wantDepthAndNormal = true;
        settings.draw.lit = isLit;
        return test::renderView(store, backend, *executor_, view, settings);
    }
    /// By the fp64 restatement, as variants are.
    render::Image mode(const std::shared_ptr<const lod::Store>& store, const lod::View& view, Mode mode,
                       bool isLit = false) {
        return draw(*reference::makeReferenceBackend(*executor_), store, view, mode, isLit);
    }
    render::Image variant(const char* name, const std::shared_ptr<const lod::Store>& store, const lod::View& view,
                          bool isLit = false) {
        for (const reference::Variant& v : reference::variants())
            if (std::string_view(name) == v.name)
                return draw(*reference::makeVariantBackend(name, *executor_), store, view, v.mode, isLit);
        ADD_FAILURE() << "no variant " << name;
        return {};
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    int stores_ = 0;
};

size_t covered(const render::Image& image) {
    return static_cast<size_t>(std::count_if(image.depth.begin(), image.depth.end(), [](float z) { return z > 0; }));
}
int red(const render::Image& image, size_t i) { return static_cast<int>(image.rgba[i] & 255u); }
/// Differences of red between neighbours of a row, well inside the picture: the mean, and how much more the largest in
/// a hundred are.
struct Roughness {
    double mean = 0, steps = 0;
};
Roughness roughness(const render::Image& image) {
    std::vector<int> off;
    for (uint32_t y = 8; y + 8 < image.height; ++y)
        for (uint32_t x = 8; x + 9 < image.width; ++x) {
            const size_t i = size_t{y} * image.width + x;
            if (image.depth[i] <= 0 || image.depth[i + 1] <= 0) continue;
            off.push_back(std::abs(red(image, i) - red(image, i + 1)));
        }
    if (off.empty()) return {};
    std::sort(off.begin(), off.end());
    const double mean = std::accumulate(off.begin(), off.end(), 0.0) / static_cast<double>(off.size());
    return {mean, off[off.size() * 99 / 100] / mean};
}

/// A square in the plane z = 0 on an uneven grid; `colourOf(i)`.
template <typename F>
std::vector<test::TestPoint> unevenSquare(int side, double height, const F& colourOf) {
    Rng rng(3);
    std::vector<test::TestPoint> points;
    for (int i = 0; i < side * side; ++i) {
        const double step = 2.0 / side;
        points.push_back({{(i % side + 0.5 + rng.uniform(-0.35, 0.35)) * step - 1,
                           (i / side + 0.5 + rng.uniform(-0.35, 0.35)) * step - 1, height},
                          {0, 0, 1},
                          colourOf(i, rng),
                          static_cast<float>(1.45 * step)});
    }
    return points;
}
lod::View above(double focal) {
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.width = view.height = 160;
    view.focalPixels = focal;
    return view;
}

TEST_F(Variants, AreOneTableWithNamesAndSources) {
    std::set<std::string> names;
    for (const reference::Variant& v : reference::variants()) {
        EXPECT_TRUE(names.insert(v.name).second) << v.name;
        EXPECT_NE(reference::makeVariantBackend(v.name, *executor_), nullptr);
        EXPECT_NE(std::string_view(v.source).find(" 20"), std::string_view::npos) << v.name << ": a paper has a year";
        EXPECT_FALSE(std::string_view(v.shows).empty());
    }
    EXPECT_EQ(reference::makeVariantBackend("splat", *executor_), nullptr);
    EXPECT_GE(names.size(), 12u);
}

TEST_F(Variants, OfShapeGrowOutlinesOrTearSurfaces) {
    const auto store = storeOf(test::samplesOf(test::Shape::torus, 4'000, 3));
    const lod::View view = test::lookAt(*store, 30, 20, 1.2, 160);
    const size_t exact = covered(mode(store, view, Mode::splat));
    EXPECT_GT(exact, 3'000u);
    EXPECT_GT(covered(variant("size-only", store, view)), exact * 104 / 100);
    EXPECT_GT(covered(variant("squares", store, view)), covered(variant("size-only", store, view)));
    EXPECT_LT(covered(variant("reduced-radii", store, view)), exact * 95 / 100);
    // Pull-push: what is not pulled leaves holes.
    EXPECT_LT(covered(variant("centre-test", store, view)), covered(mode(store, view, Mode::pullpush)) - 20);
}

TEST_F(Variants, WithoutDepthCorrectionAreSteps) {
    const auto store = storeOf(test::samplesOf(test::Shape::torus, 2'000, 3));
    const lod::View view = test::lookAt(*store, 30, 20, 1.2, 160);
    const render::Image flat = variant("flat-depth", store, view), exact = mode(store, view, Mode::splat),
                        traced =
                            *reference::trace({{store, {}, {}}}, view, {.samplesPerAxis = 1, .draw = {}}, *executor_);
    const auto wrong = [&](const render::Image& image) {
        std::vector<double> off;
        for (size_t i = 0; i < image.depth.size(); ++i)
            if (image.depth[i] > 0 && traced.depth[i] > 0) off.push_back(std::abs(image.depth[i] - traced.depth[i]));
        std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() * 9 / 10), off.end());
        return off[off.size() * 9 / 10];
    };
    const double spacing = test::spacingOf(test::Shape::torus, 2'000);
    EXPECT_GT(wrong(flat), 0.3 * spacing);
    EXPECT_LT(wrong(exact), 0.05 * spacing);
}

TEST_F(Variants, OfNormalisationRippleOnOneColour) {
    const auto store = storeOf(unevenSquare(40, 0, [](int, Rng&) { return 0xb0b0b0u; }), true);
    const lod::View view = above(150);
    const render::Image ewa = mode(store, view, Mode::ewa), raw = variant("unnormalised", store, view);
    int most = 0, mostRaw = 0;
    for (size_t i = 0; i < ewa.rgba.size(); ++i) {
        const size_t x = i % 160, y = i / 160;
        if (x < 45 || x > 115 || y < 45 || y > 115) continue;
        most = std::max(most, std::abs(red(ewa, i) - 0xb0));
        mostRaw = std::max(mostRaw, std::abs(red(raw, i) - 0xb0));
    }
    EXPECT_LE(most, 1);
    EXPECT_GE(mostRaw, 15);
}

TEST_F(Variants, OfOnePassShowWhatLiesBehind) {
    std::vector<test::TestPoint> points = unevenSquare(40, 0, [](int, Rng&) { return 0x00ff00u; });
    for (const test::TestPoint& p : unevenSquare(40, -0.5, [](int, Rng&) { return 0x0000ffu; })) points.push_back(p);
    const auto store = storeOf(points, true);  // green before red
    const lod::View view = above(150);
    const render::Image ewa = mode(store, view, Mode::ewa), sorted = variant("sorted-blending", store, view);
    size_t shines = 0, shinesSorted = 0;
    for (size_t i = 0; i < ewa.rgba.size(); ++i) {
        const size_t x = i % 160, y = i / 160;
        if (x < 45 || x > 115 || y < 45 || y > 115) continue;
        shines += red(ewa, i) > 8;
        shinesSorted += red(sorted, i) > 8;
    }
    EXPECT_EQ(shines, 0u);
    EXPECT_GT(shinesSorted, 500u);
}

/// A wall along the axis: what is moved along the axis stays in its plane, and nothing is gained.
TEST_F(Variants, OfShiftsLoseTheirNeighboursOnWallsAlongTheAxis) {
    Rng rng(9);
    std::vector<test::TestPoint> points;
    for (int i = 0; i < 100 * 40; ++i) {
        const double step = 0.05;
        points.push_back({{1 + rng.uniform(-0.2, 0.2) * step, (i % 40 - 20 + rng.uniform(0.2, 0.8)) * step,
                           -(i / 40 + rng.uniform(0.2, 0.8)) * step},
                          {-1, 0, 0},
                          rng.below(2) != 0 ? 0xffffffu : 0u,
                          static_cast<float>(1.45 * step)});
    }
    const auto store = storeOf(points, true);
    lod::View view;
    view.eye = {0, 0, 0.3};
    view.width = view.height = 200;
    view.focalPixels = 100;
    view.nearPlane = 1e-4;
    const double ewa = roughness(mode(store, view, Mode::ewa)).mean,
                 shifted = roughness(variant("z-shift", store, view)).mean;
    EXPECT_GT(shifted, 1.3 * ewa) << ewa;
}

TEST_F(Variants, OfKernelsAreSmootherTheSofterTheyEnd) {
    const auto store =
        storeOf(unevenSquare(24, 0, [](int, Rng& rng) { return rng.below(2) != 0 ? 0xffffffu : 0u; }), true);
    const lod::View view = above(150);
    const Roughness box = roughness(variant("box-kernel", store, view)),
                    gaussian = roughness(variant("gaussian-kernel", store, view)),
                    own = roughness(mode(store, view, Mode::pullpush));
    std::printf("box %.2f %.2f, Gaussian %.2f %.2f, own %.2f %.2f\n", box.mean, box.steps, gaussian.mean,
                gaussian.steps, own.mean, own.steps);
    EXPECT_GT(box.steps, 1.08 * gaussian.steps) << "where an ellipse ends";
    EXPECT_NEAR(gaussian.mean, own.mean, 0.1 * own.mean);
    EXPECT_NEAR(gaussian.steps, own.steps, 0.1 * own.steps);
}

TEST_F(Variants, OfLightAndColour) {
    const auto store = storeOf(test::samplesOf(test::Shape::statue, 1'500, 3));
    const lod::View view = test::lookAt(*store, 30, 20, 1.2, 160);
    const auto far = reference::compareImages(variant("light-per-point", store, view, true),
                                              mode(store, view, Mode::pullpush, true), 4, nullptr);
    ASSERT_TRUE(far);
    EXPECT_LT(far->foregroundPsnr, 45);
    EXPECT_EQ(far->silhouetteIou, 1);
    const render::Image grey = variant("no-colour", store, view);
    std::set<uint32_t> colours;
    for (size_t i = 0; i < grey.rgba.size(); ++i)
        if (grey.depth[i] > 0) colours.insert(grey.rgba[i]);
    EXPECT_EQ(colours.size(), 1u);
}

TEST_F(Variants, ASecondCameraSeesThePlacesOfTheFirst) {
    const auto store = storeOf(unevenSquare(60, 0, [](int, Rng&) { return 0xb0b0b0u; }), true);
    const lod::View view = above(150);
    const render::Image image = mode(store, view, Mode::splat);
    const render::Image same = reference::seenFrom(image, view, view);
    for (size_t i = 0; i < image.depth.size(); ++i)
        ASSERT_NEAR(same.depth[i], image.depth[i], 1e-5 * image.depth[i]) << i;
    // From so far aside that the square is a line: all its places lie on it.
    lod::View aside = view;
    aside.eye = {4, 0, 0};
    aside.forward = {-1, 0, 0};
    aside.right = {0, 1, 0};
    aside.down = {0, 0, -1};
    const render::Image line = reference::seenFrom(image, view, aside);
    size_t seen = 0, elsewhere = 0;
    for (size_t i = 0; i < line.depth.size(); ++i) {
        if (!(line.depth[i] > 0)) continue;
        ++seen;
        elsewhere += i / 160 != 79 && i / 160 != 80;
    }
    EXPECT_GT(seen, 40u);
    EXPECT_EQ(elsewhere, 0u);
}

}  // namespace
}  // namespace stipple
