// Mode pullpush-exact: a pyramid of discs that loses nothing. Its picture is that of mode splat, whatever the levels
// keep; against the fp64 oracle, which knows no levels; no holes in closed surfaces from anywhere.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "shaders/shared/disc_level.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/mode_checks.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

TEST(ExactLevels, AreWhatModeSplatDraws) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::anyDiscs(3000, 5), true, true);
    test::writePly(folder / "b.ply", test::samplesOf(test::Shape::statue, 60'000, 3));
    int64_t drawn = 0;
    for (const char* name : {"a", "b"}) {
        const auto store =
            test::buildAndOpen(folder / (std::string(name) + ".ply"), folder / (std::string(name) + ".st"), *executor);
        for (const bool isOrthographic : {false, true})
            for (const double distance : {0.02, 0.5, 1.5, 20.0}) {
                lod::View view = test::lookAt(*store, 40, 20, distance, 301);
                view.height = 187;
                if (isOrthographic) {
                    view.focalPixels /= glm::length(view.eye);
                    view.isOrthographic = true;
                }
                for (const double tau : {1e-4, 3.0})
                    for (auto& [backendName, backend] : test::cpuBackendsAndOracle(*executor)) {
                        const auto draw = [&](render::Mode mode) {
                            return test::renderView(store, *backend, *executor, view, test::drawnAs(mode, tau));
                        };
                        const render::Image exact = draw(render::Mode::pullpushExact),
                                            splat = draw(render::Mode::splat);
                        EXPECT_TRUE(exact.rgba == splat.rgba && exact.depth == splat.depth &&
                                    exact.normal == splat.normal)
                            << backendName << " " << name << ", " << distance << " away, error " << tau;
                        drawn += std::count_if(exact.depth.begin(), exact.depth.end(), [](float z) { return z > 0; });
                    }
            }
    }
    EXPECT_GT(drawn, 1'000'000);
}

/// What becomes of discs on levels: each is found from every pixel that it covers, and some texels are shared.
TEST(ExactLevels, HoldEveryDiscWithinTheirTaps) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Rng rng(4);
    shared::FrameConstants f{};
    f.width = 640;
    f.height = 360;
    f.focal = 500;
    f.centre = {320, 180};
    f.nearPlane = 0.01f;
    size_t held = 0, beyondTwoTaps = 0, pixels = 0, none = 0;
    for (int k = 0; k < 20'000; ++k) {
        f.orthographic = k % 2 == 0 ? 1 : 0;
        f.focal = f.orthographic != 0 ? 120.0f : 500.0f;
        const auto any = [&](double lo, double hi) { return static_cast<float>(rng.uniform(lo, hi)); };
        shared::WideDisc d{};
        d.centre = {any(-3, 3), any(-2, 2), any(0.05, 6)};
        const glm::vec3 n = glm::normalize(glm::vec3(any(-1, 1), any(-1, 1), any(-1, 1)));
        d.normal = {n.x, n.y, n.z};
        d.radius = std::exp2(any(-9, 1));
        const shared::LevelPlace p = shared::levelPlace(d, f);
        if (p.level < 0) {
            ++none;
            continue;
        }
        ++held;
        ASSERT_LT(p.x, shared::levelTexels(f.width, p.level));
        ASSERT_LT(p.y, shared::levelTexels(f.height, p.level));
        const shared::Lens lens = shared::frameLens(f);
        for (int probe = 0; probe < 200; ++probe) {
            // Places of its rim, which no other of it is farther out than.
            const glm::vec3 aside =
                glm::normalize(glm::cross(n, std::abs(n.x) < 0.7f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0)));
            const float angle = 0.0314159f * static_cast<float>(probe);
            const glm::vec3 at = glm::vec3(d.centre.x, d.centre.y, d.centre.z) +
                                 d.radius * (std::cos(angle) * aside + std::sin(angle) * glm::cross(n, aside));
            const float scale = f.focal / shared::lensDepth(lens, at.z);
            const float x = std::floor(at.x * scale + f.centre.x), y = std::floor(at.y * scale + f.centre.y);
            if (!(at.z > 0) || x < 0 || y < 0 || x >= 640 || y >= 360) continue;
            const int apart = std::max(std::abs((static_cast<int>(x) >> p.level) - p.x),
                                       std::abs((static_cast<int>(y) >> p.level) - p.y));
            ASSERT_LE(apart, shared::kLevelTaps) << "disc " << k;
            beyondTwoTaps += apart > 2;
            ++pixels;
        }
    }
    EXPECT_GT(held, 15'000u);
    EXPECT_GT(none, 20u);
    EXPECT_GT(beyondTwoTaps, pixels / 100) << "with fewer taps some would be missed";
}

TEST(ExactLevels, LeaveNoHolesInClosedSurfaces) {
    size_t looked = 0, holes = 0, ofPoints = 0;
    test::forViewsOfAClosedSurface(60, 96, -1.5, [&](const test::InsideView& v) {
        holes += v.openIn(test::drawnAs(render::Mode::pullpushExact, v.errorPixels));
        ofPoints += v.openIn(test::drawnAs(render::Mode::points, v.errorPixels));
        looked += v.pixels.size();
    });
    EXPECT_GT(looked, 100'000u);
    EXPECT_EQ(holes, 0u);
    EXPECT_GT(ofPoints, looked / 20) << "the control";
}

}  // namespace
}  // namespace stipple
