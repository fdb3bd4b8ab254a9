// Mode ewa, what belongs to a surface and what does not (SEEDS 7.2): planes do not hide themselves, both sides of a
// leaf stay apart, grids have no pinholes, outlines and horizons are where they are. The truths are written here, from
// the places of discs; each test has a control that must fail.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/mode_checks.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;

render::FrameSettings blended(render::Mode mode = render::Mode::ewa) { return test::drawnAs(mode, 1e-4, false); }

int grey(const render::Image& image, size_t pixel) { return static_cast<int>(image.rgba[pixel] >> 8 & 255); }
int coverage(const render::Image& image, size_t pixel) { return static_cast<int>(image.rgba[pixel] >> 24); }

/// A view along +z of (0, 0, distance), the world's y downwards.
lod::View viewAhead(uint32_t size, double focal) {
    lod::View view;
    view.eye = {0, 0, 0};
    view.forward = {0, 0, 1};
    view.right = {1, 0, 0};
    view.down = {0, 1, 0};
    view.width = view.height = size;
    view.focalPixels = focal;
    view.nearPlane = 1e-4;
    return view;
}

/// A grid of discs about `centre` in a plane that leans by `lean` (radians) about x; colours by chance.
struct Grid {
    dvec3 centre{0};
    double lean = 0, spacing = 1, radius = 0;
    int half = 0;
    dvec3 along() const { return {0, std::cos(lean), std::sin(lean)}; }
    dvec3 normal() const { return {0, std::sin(lean), -std::cos(lean)}; }
    std::vector<test::TestPoint> points(Rng& rng) const {
        std::vector<test::TestPoint> out;
        for (int y = -half; y <= half; ++y)
            for (int x = -half; x <= half; ++x)
                out.push_back({centre + spacing * (dvec3(x, 0, 0) + double(y) * along()), glm::vec3(normal()),
                               static_cast<uint32_t>(rng.below(256)) * 0x010101u, static_cast<float>(radius)});
        return out;
    }
};

/// What a pixel sees of discs in one plane, all of them: Gaussians where discs are, seen by the plane's own map about
/// each centre, widened by half a square pixel, cut at two sigmas. `isHidden`: of a disc, deeper than the plane there
/// by so much (world units along the view), it is not seen.
double blendAt(const std::vector<reference::Disc>& discs, const lod::View& view, size_t pixel, double hiddenBeyond) {
    const dvec2 at(double(pixel % view.width) + 0.5 - 0.5 * view.width,
                   double(pixel / view.width) + 0.5 - 0.5 * view.height);
    const dvec3 ray(at.x / view.focalPixels, at.y / view.focalPixels, 1);
    double sum = 0, weights = 0;
    for (const reference::Disc& d : discs) {
        const double z = d.position.z, f = view.focalPixels / z, sigma = d.radius / 1.5;
        const dvec2 off = at - f * dvec2(d.position);
        if (glm::length(off) > 12 + 3 * sigma * f) continue;
        const double here = glm::dot(d.normal, d.position) / glm::dot(d.normal, ray);
        if (z > here + hiddenBeyond) continue;
        // Of the plane's two axes: across x, and down the slope, which the view shortens.
        const dvec3 slope(0, -d.normal.z, d.normal.y);
        const dvec2 u(f * sigma, 0), v = f * sigma * (dvec2(slope) - slope.z * dvec2(d.position) / z);
        const double xx = u.x * u.x + v.x * v.x + 0.5, xy = v.x * v.y, yy = v.y * v.y + 0.5, det = xx * yy - xy * xy;
        const double rho2 = (yy * off.x * off.x - 2 * xy * off.x * off.y + xx * off.y * off.y) / det;
        if (rho2 >= 4) continue;
        const double w =
            std::sqrt((xx - 0.5) * (yy - 0.5) / det) * (std::exp(-0.5 * rho2) - std::exp(-2)) / (1 - std::exp(-2));
        sum += w * d.colour.y;
        weights += w;
    }
    return weights > 0 ? reference::encodeSrgb(sum / weights) : 0;
}

/// A plane of discs a centimetre apart, from 1 to 100,000 m away, always as large in the picture: none of its discs
/// counts as behind the others, although fp32 tells depths only to 8 mm there.
TEST(EwaVisibility, APlaneHidesNothingOfItselfFromOneMetreToAHundredKilometres) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const double lean : {0.0, 0.8, 1.3})
        for (const double distance : {1.0, 10.0, 1e2, 1e3, 1e4, 1e5}) {
            Grid grid{{0, 0, distance}, lean, 0.001, 0.0011, static_cast<int>(24 / std::cos(lean))};
            if (distance > 1) grid.spacing *= 10, grid.radius *= 10;
            Rng rng(3);
            test::writePly(folder / "a.ply", grid.points(rng), true, true);
            const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 16384);
            const lod::View view = viewAhead(48, 2 * distance / grid.spacing);
            const std::vector<reference::Disc> discs = test::leafDiscs(*store);
            std::vector<double> truth;
            size_t controls = 0;
            for (size_t i = 0; i < size_t{48} * 48; ++i) {
                truth.push_back(blendAt(discs, view, i, 1e300));
                controls += std::abs(blendAt(discs, view, i, 1e-3 * grid.spacing) - truth.back()) > 8;
            }
            for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
                const render::Image image = test::renderView(store, *backend, *executor, view, blended());
                size_t off = 0;
                int worst = 0;
                for (size_t i = 0; i < truth.size(); ++i) {
                    const int by = std::abs(grey(image, i) - static_cast<int>(truth[i]));
                    off += by > 2;
                    worst = std::max(worst, by);
                }
                std::printf("lean %.1f from %g: %s %zu off, worst %d, control %zu\n", lean, distance, name.c_str(), off,
                            worst, controls);
                EXPECT_EQ(off, 0u) << name << ", leaning " << lean << ", from " << distance;
            }
            if (lean > 0) EXPECT_GT(controls, truth.size() / 4) << "the control hides what is behind the ray";
        }
}

/// A leaf as two sheets half a radius apart, red seen from above and green from below: from either side and aslant
/// none of the other is mixed in. The control: were both to face the eye, they would be one surface.
TEST(EwaVisibility, TheTwoSidesOfALeafDoNotMix) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    constexpr double kStep = 0.01, kRadius = 0.011;
    for (const bool areBothUp : {false, true}) {
        std::vector<test::TestPoint> points;
        for (int y = -60; y <= 60; ++y)
            for (int x = -60; x <= 60; ++x) {
                points.push_back({{kStep * x, kStep * y, 0.25 * kRadius}, {0, 0, 1}, 0x0000ffu, float(kRadius)});
                points.push_back({{kStep * (x + 0.5), kStep * (y + 0.3), -0.25 * kRadius},
                                  {0, 0, areBothUp ? 1.0f : -1.0f},
                                  0x00ff00u,
                                  float(kRadius)});
            }
        test::writePly(folder / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 65536);
        for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor))
            for (const double angle : {0.0, 40.0, 70.0, 80.0, 100.0, 140.0, 180.0}) {
                lod::View view;
                const double a = glm::radians(angle);
                view.forward = {0, std::sin(a), -std::cos(a)};
                view.eye = -3.0 * view.forward;
                view.right = {1, 0, 0};
                view.down = glm::cross(view.forward, view.right);
                view.width = view.height = 160;
                view.focalPixels = 600;
                view.nearPlane = 0.01;
                const render::Image image = test::renderView(store, *backend, *executor, view, blended());
                size_t mixed = 0, pure = 0;
                for (size_t i = 0; i < image.rgba.size(); ++i) {
                    const uint32_t red = image.rgba[i] & 255, green = image.rgba[i] >> 8 & 255;
                    if (coverage(image, i) < 255) continue;
                    const uint32_t own = angle < 90 ? red : green, other = angle < 90 ? green : red;
                    mixed += other > 2;
                    pure += own > 250 && other <= 2;
                }
                if (areBothUp) {
                    if (angle < 80) EXPECT_GT(mixed, 1'000u) << "control";
                    continue;
                }
                EXPECT_GT(pure, 1'000u) << name << " at " << angle;
                EXPECT_LE(mixed, (mixed + pure) / 1000) << name << " at " << angle;
            }
    }
}

/// Square grids at every sixteenth of a pixel, from half a pixel to nine apart, upright and leaning: the opaque parts
/// leave no pixel open. The control: parts of one sigma (0.685 spacings) do.
TEST(EwaVisibility, AGridHasNoPinholesWhereverPixelsLie) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    size_t open = 0, controls = 0, looked = 0;
    for (const double lean : {0.0, 1.0})
        for (const double pixels : {0.5, 1.0, 2.3, 9.0}) {
            Grid grid{{0, 0, 1}, lean, pixels / 1000, 0.7072 * pixels / 1000, static_cast<int>(40 / pixels) + 14};
            Rng rng(5);
            test::writePly(folder / "a.ply", grid.points(rng), true, true);
            const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 65536);
            std::vector<reference::Disc> discs = test::leafDiscs(*store);
            for (reference::Disc& d : discs) d.radius = 0.685 * grid.spacing;
            for (int shift = 0; shift < 256; ++shift) {
                lod::View view = viewAhead(24, 1000);
                view.eye.x = shift % 16 / 16.0 / 1000;
                view.eye.y = shift / 16 / 16.0 / 1000;  // NOLINT(bugprone-integer-division): the row
                const render::Image image = test::renderView(store, *backend, *executor, view, blended());
                looked += image.rgba.size();
                for (size_t i = 0; i < image.rgba.size(); ++i) open += coverage(image, i) < 255;
                if (shift % 16 != shift / 16) continue;
                const test::RayHits hits = test::hitDiscs(discs, view, 0.01);
                for (size_t i = 0; i < image.rgba.size(); ++i) controls += !hits.isCovered(i);
            }
        }
    std::printf("%zu pixels: %zu open; with parts of one sigma %zu of %zu\n", looked, open, controls, looked / 16);
    EXPECT_EQ(open, 0u);
    EXPECT_GT(controls, 100u);
}

/// A ball of discs: what covers half a pixel and more is the ball, within 0.2 % of its area.
TEST(EwaVisibility, OutlinesOfABallAreTheBalls) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    std::vector<test::TestPoint> points;
    constexpr int kCount = 60'000;
    for (int k = 0; k < kCount; ++k) {  // spiral of Fibonacci
        const double z = 1 - (2 * k + 1.0) / kCount, a = 2.399963229728653 * k, r = std::sqrt(1 - z * z);
        const dvec3 n(r * std::cos(a), r * std::sin(a), z);
        points.push_back({n, glm::vec3(n), 0x808080u});
    }
    test::writePly(folder / "a.ply", points);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 65536);
    for (const double distance : {3.0, 8.0, 20.0}) {
        lod::View view = viewAhead(400, 150 * distance);
        view.eye.z = -distance;
        const auto overlap = [&](const render::Image& image, double radius) {
            size_t both = 0, either = 0;
            for (size_t i = 0; i < image.rgba.size(); ++i) {
                const dvec3 ray = glm::normalize(test::rayThrough(view, double(i % 400) + 0.5, double(i / 400) + 0.5));
                const bool isBall = glm::length(glm::cross(ray, view.eye)) < radius,
                           isDrawn = coverage(image, i) >= 128;
                both += isBall && isDrawn;
                either += isBall || isDrawn;
            }
            return static_cast<double>(both) / static_cast<double>(either);
        };
        const render::Image image = test::renderView(store, *backend, *executor, view, blended());
        const double iou = overlap(image, 1), control = overlap(image, 1.005);
        std::printf("ball from %g: IoU %.4f, of one half a per cent larger %.4f\n", distance, iou, control);
        EXPECT_GE(iou, 0.998);
        EXPECT_LT(control, 0.998);
    }
}

/// A disc whose centre lies beside the picture covers what it reaches in it, in every mode that draws discs whole; the
/// same disc farther out covers nothing.
TEST(EwaVisibility, ADiscBesideThePictureReachesIn) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const double beside : {0.31, 0.55}) {
        // Four far ones, so that the box is wide and the disc one among others.
        std::vector<test::TestPoint> points{{{beside, 0, 1}, {0, 0, -1}, 0xffffffu, 0.2f}};
        for (const double x : {-0.9, 0.9})
            for (const double y : {-0.9, 0.9}) points.push_back({{x, y, 1}, {0, 0, -1}, 0xffffffu, 0.01f});
        test::writePly(folder / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
        const lod::View view = viewAhead(101, 200);  // to 0.2525 to each side
        for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor))
            for (const render::Mode mode : {render::Mode::ewa, render::Mode::splat, render::Mode::pullpush}) {
                const render::Image image = test::renderView(store, *backend, *executor, view, blended(mode));
                size_t wrong = 0, there = 0;
                for (size_t i = 0; i < image.rgba.size(); ++i) {
                    const double x = (double(i % 101) - 50) / 200 - beside, y = (double(i / 101) - 50) / 200;
                    const double inside = (0.2 - std::hypot(x, y)) * 200;  // px
                    there += inside > 0;
                    // Radii are stored to a 23rd; outlines of kernels are soft.
                    const bool isDrawn = coverage(image, i) >= 128;
                    wrong += inside > 2 ? !isDrawn : inside < -4 && isDrawn;
                }
                EXPECT_EQ(there > 500, beside < 0.4);
                EXPECT_EQ(wrong, 0u) << name << ", mode " << static_cast<int>(mode) << ", " << beside << " beside";
            }
    }
}

/// Discs of a floor that the near plane cuts: fronts are cut where it is, kernels with their centres; on all backends
/// alike. Without the plane there is more of the floor.
TEST(EwaVisibility, DiscsThatTheNearPlaneCutsAreThoseOfTheOracle) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Rng rng(6);
    Grid floor;
    floor.centre = {0, 0.5, 2};
    floor.lean = 1.3;
    floor.spacing = 0.05;
    floor.radius = 0.07;
    floor.half = 20;
    test::writePly(folder / "a.ply", floor.points(rng), true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const auto oracle = reference::makeReferenceBackend(*executor);
    const auto covered = [](const render::Image& image) {
        return std::count_if(image.depth.begin(), image.depth.end(), [](float z) { return z > 0; });
    };
    lod::View view = viewAhead(160, 250);
    const auto whole = covered(test::renderView(store, *oracle, *executor, view, blended()));
    for (const double nearPlane : {1.4, 1.8, 2.2}) {
        view.nearPlane = nearPlane;
        const render::Image expected = test::renderView(store, *oracle, *executor, view, blended());
        EXPECT_GT(covered(expected), 100);
        EXPECT_LT(covered(expected), whole - 300);
        for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
            const render::Image image = test::renderView(store, *backend, *executor, view, blended());
            const auto d = reference::compareImages(image, expected, 4, nullptr).value();
            EXPECT_GE(d.psnr, 50) << name << ", near plane " << nearPlane;
            EXPECT_LE(d.differingFraction, 0.001) << name << ", near plane " << nearPlane;
            size_t deeper = 0;
            for (size_t i = 0; i < image.depth.size(); ++i)
                deeper += std::abs(image.depth[i] - expected.depth[i]) > 1e-3f * expected.depth[i] ? 1 : 0;
            EXPECT_LE(deeper, 3u) << name << ", near plane " << nearPlane;
        }
    }
}

/// A checker of cells of a third of a pixel and less is grey up to the horizon; one disc a pixel shows cells.
TEST(EwaVisibility, ACheckerIsGreyBeforeTheHorizonAndNothingIsDrawnAboveIt) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    constexpr double kStep = 0.01;
    std::vector<test::TestPoint> points;
    for (int y = 0; y < 1200; ++y)
        for (int x = -200; x < 200; ++x)
            points.push_back({{(x + 0.5) * kStep, 0.5, (y + 0.5) * kStep},
                              {0, -1, 0},
                              (x / 2 + 200 + y / 2) % 2 == 0 ? 0xffffffu : 0u,
                              static_cast<float>(1.1 * kStep)});
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 65536);
    lod::View view = viewAhead(60, 60);
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const auto look = [&](render::Mode mode, size_t& looked, size_t& above) {
            const render::Image image = test::renderView(store, *backend, *executor, view, blended(mode));
            size_t off = 0;
            looked = above = 0;
            for (size_t i = 0; i < image.rgba.size(); ++i) {
                const double x = (double(i % 60) - 29.5) / 60, y = (double(i / 60) - 29.5) / 60;
                // (A disc that faces away from the ray by a pixel's depth is as thick as the low-pass: two pixels.)
                if (y < -2.0 / 60) above += coverage(image, i) > 0;
                const double z = 0.5 / y;
                if (!(y > 0) || z < 4 || z > 7 || std::abs(x * z) > 1.8) continue;
                ++looked;
                off += std::abs(grey(image, i) - 188) > 1;
            }
            return off;
        };
        size_t looked = 0, above = 0;
        EXPECT_EQ(look(render::Mode::ewa, looked, above), 0u) << name;
        EXPECT_GT(looked, 50u);
        EXPECT_EQ(above, 0u) << name;
        EXPECT_GT(look(render::Mode::splat, looked, above), looked / 2) << "control: unfiltered";
    }
}

/// The same bytes for any number of threads, for any order of the input, and whatever else is resident.
TEST(EwaVisibility, IsTheSameBytesForAnyOrderAndResidency) {
    const test::TempFolder folder;
    const auto few = makeTbbExecutor(1), some = makeTbbExecutor(4), many = makeTbbExecutor(16);
    std::vector<test::TestPoint> points = test::anyDiscs(20'000, 6);
    test::writePly(folder / "a.ply", points, true, true);
    Rng rng(12);
    for (size_t i = points.size() - 1; i > 0; --i) std::swap(points[i], points[rng.below(i + 1)]);
    test::writePly(folder / "b.ply", points, true, true);
    const auto a = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *some),
               b = test::buildAndOpen(folder / "b.ply", folder / "b.stipple", *many);
    lod::View view = viewAhead(32, 40);
    view.width = 333;
    render::FrameSettings settings = blended();
    settings.budgets.errorPixels = 2;
    const auto draw = [&](const auto& store, Executor& executor, const lod::View* before) {
        const auto backend = cpu::makeCpuBackend(executor);
        const std::vector<render::PlacedStore> placed{{store, {}, {}}};
        const auto state = render::makeFrameState(placed, *backend, executor, {});
        if (before != nullptr) EXPECT_TRUE(render::renderUntilComplete(*state, *before, blended()));
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
        return state->image;
    };
    const render::Image image = draw(a, *few, nullptr);
    lod::View close = view;
    close.eye.z = 1.2;
    const auto isSame = [&](const render::Image& o) {
        return image.rgba == o.rgba && image.depth == o.depth && image.normal == o.normal;
    };
    EXPECT_TRUE(isSame(draw(a, *some, nullptr)));
    EXPECT_TRUE(isSame(draw(a, *many, nullptr)));
    EXPECT_TRUE(isSame(draw(a, *test::makeBackwardsExecutor(), nullptr))) << "the last pieces first";
    EXPECT_TRUE(isSame(draw(b, *some, nullptr))) << "another order";
    EXPECT_TRUE(isSame(draw(a, *some, &close))) << "more is resident";
    settings.draw.lowPass *= 1.01f;
    EXPECT_FALSE(isSame(draw(a, *some, nullptr))) << "control";
}

/// What no kernel can be is refused.
TEST(Ewa, RefusesFiltersThatAreNone) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    test::writePly(folder / "a.ply", test::samplesOf(test::Shape::statue, 500, 3));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const auto state = render::makeFrameState({store}, *backend, *executor, {});
    const lod::View view = viewAhead(32, 40);
    for (const float bad : {-1.0f, std::nanf(""), 1e9f, HUGE_VALF}) {
        render::FrameSettings settings = blended();
        settings.draw.lowPass = bad;
        EXPECT_FALSE(render::renderUntilComplete(*state, view, settings)) << bad;
        settings = blended();
        settings.draw.kernelSupport = bad;
        EXPECT_FALSE(render::renderUntilComplete(*state, view, settings)) << bad;
    }
    EXPECT_TRUE(render::renderUntilComplete(*state, view, blended()));
}

}  // namespace
}  // namespace stipple
