// Mode ewa, per surfel: against the brute force of the fp64 restatement, and against what pixels make of their sums.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "lod/builder/weights/add.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

std::shared_ptr<const lod::Store> weighed(const std::string& ply, const std::string& store, Executor& executor) {
    test::build({ply}, store, executor);
    Progress silent(false);
    EXPECT_TRUE(lod::addSurfelWeights(store, executor, silent));
    return std::make_shared<const lod::Store>(std::move(*lod::openStore(store)));
}

render::FrameSettings perSurfel(bool is = true) {
    render::FrameSettings settings;
    settings.mode = render::Mode::ewa;
    settings.wantDepthAndNormal = true;
    settings.draw.perSurfel = is;
    return settings;
}

lod::View viewFrom(const dvec3& eye, double focal) {
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.eye = eye;
    view.focalPixels = focal;
    view.width = 201;
    view.height = 151;
    view.nearPlane = 1e-6;
    return view;
}

/// At the leaves, where parents and children meet, and with wider kernels. The control: per pixel is another picture.
TEST(PerSurfel, IsWhatTheBruteForceSays) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto oracle = reference::makeReferenceBackend(*executor);
    test::writePly(folder / "a.ply", test::anyDiscs(3000, 5), true, true);
    test::writePly(folder / "b.ply", test::samplesOf(test::Shape::statue, 20'000, 3));
    for (const char* name : {"a", "b"}) {
        const auto store =
            weighed(folder / (std::string(name) + ".ply"), folder / (std::string(name) + ".stipple"), *executor);
        for (const auto& [tau, support] : {std::pair{1e-4, 2.0f}, {4.0, 2.0f}, {4.0, 3.0f}})
            for (const bool isOrthographic : {false, true}) {
                lod::View view = viewFrom({0.2, 0.1, 3.5}, isOrthographic ? 80 : 300);
                view.isOrthographic = isOrthographic;
                render::FrameSettings settings = perSurfel();
                settings.budgets.errorPixels = tau;
                settings.draw.kernelSupport = support;
                const render::Image truth = test::renderView(store, *oracle, *executor, view, settings);
                for (auto& [backendName, backend] : test::cpuBackendsAndOracle(*executor)) {
                    if (backendName == "fp64") continue;
                    SCOPED_TRACE(testing::Message() << name << " " << backendName << ", tau " << tau << ", support "
                                                    << support << (isOrthographic ? ", orthographic" : ""));
                    const render::Image image = test::renderView(store, *backend, *executor, view, settings);
                    EXPECT_GE(test::drawnPsnr(image, truth), 50);
                    size_t drawn = 0, coverage = 0, depth = 0;
                    for (size_t i = 0; i < image.rgba.size(); ++i) {
                        drawn += truth.depth[i] > 0;
                        coverage +=
                            std::abs(static_cast<int>(image.rgba[i] >> 24) - static_cast<int>(truth.rgba[i] >> 24)) > 2;
                        depth += truth.depth[i] > 0 && std::abs(image.depth[i] / truth.depth[i] - 1) > 1e-3f;
                    }
                    EXPECT_GT(drawn, 1'000u);
                    EXPECT_LE(coverage, drawn / 1000);
                    EXPECT_LE(depth, drawn / 500);  // (orthographic, kernels of 3 sigmas: planes that are seen edge-on)
                    settings.draw.perSurfel = false;
                    const render::Image other = test::renderView(store, *backend, *executor, view, settings);
                    settings.draw.perSurfel = true;
                    EXPECT_LT(test::drawnPsnr(other, truth), 50);
                }
            }
    }
}

/// On a smooth surface that was sampled irregularly (by a third of the spacing), at its leaves: per surfel and per
/// pixel are alike by 30 dB. The control: without weights, as if it were a grid, by less than 25.
TEST(PerSurfel, LooksAsPerPixelDoes) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto points = test::samplesOf(test::Shape::statue, 20'000, 3);
    test::writePly(folder / "a.ply", points);
    const auto store = weighed(folder / "a.ply", folder / "a.stipple", *executor);
    const auto plain = test::buildAndOpen(folder / "a.ply", folder / "b.stipple", *executor);
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const lod::View view = viewFrom({0, 0, 2.2}, 300);
        render::FrameSettings settings = perSurfel();
        settings.budgets.errorPixels = 1e-4;
        const auto draw = [&](const auto& of, bool is) {
            settings.draw.perSurfel = is;
            return test::renderView(of, *backend, *executor, view, settings);
        };
        const render::Image pixel = draw(store, false), surfel = draw(store, true), even = draw(plain, true);
        const double like = test::drawnPsnr(surfel, pixel), control = test::drawnPsnr(even, pixel);
        std::printf("%s: per surfel %.1f dB from per pixel, without weights %.1f\n", name.c_str(), like, control);
        EXPECT_GE(like, 30) << name;
        EXPECT_LT(control, 25) << name;
    }
}

/// A leaf before a wall: what its kernels do not fill at its rim is divided, so that no dark line is drawn around it,
/// and nothing of the sky is seen there.
TEST(PerSurfel, RimsWithinThePictureAreNotDark) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::vector<test::TestPoint> points;
    for (int y = -60; y <= 60; ++y)
        for (int x = -60; x <= 60; ++x) {
            points.push_back({{0.01 * x, 0.01 * y, 0}, {0, 0, 1}, 0x808080u});
            if (x * x + y * y <= 900) points.push_back({{0.01 * x, 0.01 * y, 0.3}, {0, 0, 1}, 0x808080u});
        }
    test::writePly(folder / "a.ply", points);
    const auto store = weighed(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.focalPixels = 900;
    render::FrameSettings settings = perSurfel();
    settings.draw.lit = false;
    settings.draw.background = {0, 0, 1};
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const render::Image image = test::renderView(store, *backend, *executor, view, settings);
        size_t dark = 0, light = 0, inside = 0;
        uint32_t lightest = 0;
        for (uint32_t y = 60; y < view.height - 60; ++y)
            for (uint32_t x = 60; x < view.width - 60; ++x) {
                const uint32_t rgba = image.rgba[y * view.width + x];
                ++inside;
                dark += (rgba & 255u) < 0x80u - 4 || (rgba >> 16 & 255u) < 0x80u - 4;
                light += (rgba & 255u) > 0x80u + 8;
                lightest = std::max(lightest, rgba & 255u);
            }
        std::printf("%s: %zu of %zu pixels lighter than by 8, at most by %d\n", name.c_str(), light, inside,
                    static_cast<int>(lightest) - 0x80);
        EXPECT_GT(inside, 20'000u);
        EXPECT_EQ(dark, 0u) << name;
        // Outlines in steps: what reaches in from a corner counts for more.
        EXPECT_LE(light, inside / 200) << name;
        EXPECT_LE(lightest, 0x80u + 24) << name;
    }
}

}  // namespace
}  // namespace stipple
