// Mode splat against rays and discs by brute force in fp64 (tests/support/drawn_discs.h): coverage and depth of every
// pixel, colours and normals of the disc in front; closed surfaces from anywhere; the same bytes for any threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/mode_checks.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

render::FrameSettings splats() { return test::drawnAs(render::Mode::splat); }

/// Pixels that hold the centre of a disc.
std::vector<bool> centresOf(const std::vector<reference::Disc>& discs, const lod::View& view) {
    std::vector<bool> out(size_t{view.width} * view.height);
    for (const reference::Disc& d : discs) {
        const dvec3 off = d.position - view.eye;
        const double z = glm::dot(off, view.forward);
        // Those that are seen from behind are not drawn, and excuse nothing.
        const double facing = glm::dot(d.normal, view.isOrthographic ? view.forward : off);
        if ((d.flags & shared::kFlagTwoSided) == 0 && facing >= 0) continue;
        const double scale = view.focalPixels / (view.isOrthographic ? 1 : z);
        const double x = scale * glm::dot(off, view.right) + 0.5 * view.width,
                     y = scale * glm::dot(off, view.down) + 0.5 * view.height;
        if (z > 0 && x >= 0 && y >= 0 && x < view.width && y < view.height)
            out[static_cast<size_t>(y) * view.width + static_cast<size_t>(x)] = true;
    }
    return out;
}

/// Depth of the first disc that each pixel's ray meets, 0: none; every ray against every disc.
std::vector<double> frontOf(const std::vector<reference::Disc>& discs, const lod::View& view) {
    std::vector<double> out(size_t{view.width} * view.height, 0);
    const bool isFlat = view.isOrthographic;
    for (const reference::Disc& d : discs) {
        const dvec3 toDisc = d.position - view.eye;
        const double facing = glm::dot(d.normal, isFlat ? view.forward : toDisc);
        if ((d.flags & shared::kFlagTwoSided) == 0 && facing >= 0) continue;
        for (size_t i = 0; i < out.size(); ++i) {
            const double x = static_cast<double>(i % view.width) + 0.5, y = static_cast<double>(i / view.width) + 0.5;
            // Parallel rays of orthographic views begin beside the eye.
            const dvec3 from =
                isFlat ? ((x - 0.5 * view.width) * view.right + (y - 0.5 * view.height) * view.down) / view.focalPixels
                       : dvec3(0);
            const dvec3 ray = isFlat ? view.forward : test::rayThrough(view, x, y), at = toDisc - from;
            const double t = glm::dot(d.normal, at) / glm::dot(d.normal, ray);
            const dvec3 off = t * ray - at;
            if (t > 1e-4 && glm::dot(off, off) <= d.radius * d.radius && (out[i] == 0 || t < out[i])) out[i] = t;
        }
    }
    return out;
}

struct Wrong {
    size_t covered = 0, missing = 0, tooMuch = 0, depth = 0;
};
/// Of a picture of full detail. A ray may pass a rim on one side or the other: within 1e-4 of the depth, or not.
/// `rounding`: of depths, world units; in orthographic views they are rounded as places are, however near.
Wrong compare(const render::Image& image, const std::vector<double>& truth, const std::vector<bool>& centres,
              double rounding = 0) {
    Wrong w;
    for (size_t i = 0; i < image.depth.size(); ++i) {
        const double z = image.depth[i], front = truth[i];
        w.covered += front > 0;
        w.missing += front > 0 && z <= 0;
        w.tooMuch += front <= 0 && !centres[i] && z > 0;
        if (front <= 0 || z <= 0) continue;
        const double most = 1e-4 * front + rounding;
        w.depth += z > front + most || (z < front - most && !centres[i]);
    }
    return w;
}

TEST(Splats, CoverWhatRaysMeetAtItsDepth) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::anyDiscs(2000, 5), true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const auto discs = test::leafDiscs(*store);
    // From outside, from between the discs (some reach behind the eye), through a wide lens, far away.
    struct Look {
        dvec3 eye;
        double focal;
        bool isOrthographic = false;
    };
    for (const Look& look : {Look{{0.2, 0.1, 3.5}, 300},
                             {{0.1, 0.05, 0.3}, 120},
                             {{-0.4, 0.3, 0.9}, 60},
                             {{0, 0.1, 60}, 6000},
                             {{0.1, 0.1, 3}, 80, true},
                             {{0.1, 0.1, 0.2}, 150, true}}) {
        lod::View view = test::viewFromAbove({0, 0, 0});
        view.eye = look.eye;
        view.focalPixels = look.focal;
        view.isOrthographic = look.isOrthographic;
        view.width = 201;
        view.height = 151;
        view.focalPixels *= 0.65;
        view.nearPlane = 1e-6;
        const std::vector<bool> centres = centresOf(discs, view);
        const std::vector<double> truth = frontOf(discs, view);
        for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
            SCOPED_TRACE(testing::Message() << name << " from " << look.eye.z);
            const Wrong w = compare(test::renderView(store, *backend, *executor, view, splats()), truth, centres,
                                    look.isOrthographic ? 1e-6 : 0);
            EXPECT_GT(w.covered, 8'000u);
            EXPECT_LE(w.missing, w.covered / 5000);
            EXPECT_LE(w.tooMuch, w.covered / 5000);
            EXPECT_LE(w.depth, w.covered / 2000);
            // The control: a pixel a record covers little of it.
            render::FrameSettings points = splats();
            points.mode = render::Mode::points;
            if (look.focal > 200)
                EXPECT_GT(compare(test::renderView(store, *backend, *executor, view, points), truth, centres).missing,
                          w.covered / 4);
        }
    }
}

// Radii and spacings are codes, so that a disc is often just as wide as its node's spacing: whether it stands alone
// (and shows itself beside what rays meet of it) must not be left to rounding. (It was: 63 pixels here, and four
// statues of six.)
TEST(Splats, JustAsWideAsTheirSpacingAreThoseOfTheOracle) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto oracle = reference::makeReferenceBackend(*executor);
    const auto backend = cpu::makeCpuBackend(*executor);
    constexpr size_t kSamples = 6000;
    std::vector<test::TestPoint> points = test::samplesOf(test::Shape::torus, kSamples, 11);
    size_t shown = 0, unlike = 0;
    for (int sixteenth = -8; sixteenth <= 8; ++sixteenth) {
        for (test::TestPoint& p : points)
            p.radius =
                static_cast<float>(0.5 * test::spacingOf(test::Shape::torus, kSamples) * std::exp2(sixteenth / 16.0));
        test::writePly(folder / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
        for (const double distance : {1.0, 1.7}) {
            const lod::View view = test::lookAt(*store, 30, 20, distance, 320);
            render::FrameSettings settings = splats();
            settings.budgets.errorPixels = 0.5;
            const render::Image drawn = test::renderView(store, *backend, *executor, view, settings),
                                restated = test::renderView(store, *oracle, *executor, view, settings);
            for (size_t i = 0; i < drawn.depth.size(); ++i) {
                shown += drawn.depth[i] > 0;
                unlike += (drawn.depth[i] > 0) != (restated.depth[i] > 0);
            }
        }
    }
    std::printf("%zu of %zu pixels shown by one alone\n", unlike, shown);
    EXPECT_GT(shown, 100'000u);
    EXPECT_LE(unlike, shown / 20'000);
}

TEST(Splats, ShowTheColoursAndNormalsOfTheDiscInFront) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    // Two crossing squares of many discs: red and green.
    std::vector<test::TestPoint> points;
    for (int k = 0; k < 2; ++k)
        for (int y = -40; y <= 40; ++y)
            for (int x = -40; x <= 40; ++x) {
                const double a = 0.02 * x, b = 0.02 * y, tilt = k == 0 ? 0.5 : -0.5;
                points.push_back(
                    {{a, b, tilt * a}, glm::normalize(glm::vec3(-tilt, 0, 1)), k == 0 ? 0x0000ffu : 0x00ff00u, 0.02f});
            }
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.focalPixels = 700;
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        SCOPED_TRACE(name);
        render::FrameSettings settings = splats();
        settings.draw.lit = false;
        const render::Image image = test::renderView(store, *backend, *executor, view, settings);
        size_t wrong = 0, seen = 0;
        for (size_t i = 0; i < image.depth.size(); ++i) {
            const dvec3 ray =
                test::rayThrough(view, static_cast<double>(i % 400) + 0.5, static_cast<double>(i / 400) + 0.5);
            // Where the ray meets the planes z = 0.5 x and z = -0.5 x: the nearer is in front.
            const auto depthOf = [&](double tilt) { return (tilt * view.eye.x - view.eye.z) / (ray.z - tilt * ray.x); };
            const double red = depthOf(0.5), green = depthOf(-0.5);
            const dvec3 at = view.eye + std::min(red, green) * ray;
            if (std::abs(at.x) > 0.78 || std::abs(at.y) > 0.78 || std::abs(red - green) < 0.02) continue;
            ++seen;
            const bool isRed = red < green;
            const glm::vec3 n(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            const glm::vec3 truth = glm::normalize(glm::vec3(isRed ? -0.5 : 0.5, 0, 1));
            wrong += (image.rgba[i] & 0xffffffu) != (isRed ? 0x0000ffu : 0x00ff00u) || glm::dot(n, truth) < 0.99998f ||
                     std::abs(image.depth[i] - std::min(red, green)) > 1e-4;
        }
        EXPECT_GT(seen, 40'000u);
        EXPECT_EQ(wrong, 0u);
    }
}

/// A checker of points in a plane, leant off it by up to `lean`.
std::vector<test::TestPoint> checkerOf(double lean) {
    constexpr int kSide = 61;
    constexpr double kStep = 2.0 / kSide;
    std::vector<test::TestPoint> points;
    Rng rng(4);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x)
            points.push_back({{(x + 0.5) * kStep - 1, (y + 0.5) * kStep - 1, 0},
                              glm::normalize(dvec3(lean * rng.uniform(-1, 1), lean * rng.uniform(-1, 1), 1)),
                              (x / 4 + y / 4) % 2 == 0 ? 0xffffffu : 0u,
                              static_cast<float>(kStep)});
    return points;
}

// Discs in one plane are equally deep wherever they overlap, so that which of them is seen there is rounding: pictures
// of two backends need not agree, but each shows one of those. (Where they lean by some degrees, depths decide, and
// they agree.)
TEST(Splats, InOnePlaneShowOneOfTheEquallyDeep) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writePly(folder / "flat.ply", checkerOf(0), true, true);
    test::writePly(folder / "leant.ply", checkerOf(0.1), true, true);
    const auto flat = test::buildAndOpen(folder / "flat.ply", folder / "flat.stipple", *executor, 8192),
               leant = test::buildAndOpen(folder / "leant.ply", folder / "leant.stipple", *executor, 8192);
    const auto discs = test::leafDiscs(*flat);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.forward = glm::normalize(dvec3(0.1, 0.8, -1));
    view.right = glm::normalize(glm::cross(view.forward, dvec3(0, 0, 1)));
    view.down = glm::cross(view.forward, view.right);
    view.eye = -2.2 * view.forward;
    view.width = 201;
    view.height = 151;
    view.focalPixels = 150;
    const render::FrameSettings settings = test::drawnAs(render::Mode::splat, 1e-4, false);
    const auto oracle = reference::makeReferenceBackend(*executor);
    const render::Image truth = test::renderView(flat, *oracle, *executor, view, settings),
                        truthOfLeant = test::renderView(leant, *oracle, *executor, view, settings);
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const render::Image image = test::renderView(flat, *backend, *executor, view, settings);
        size_t covered = 0, unlike = 0, wrong = 0;
        for (size_t i = 0; i < image.rgba.size(); ++i) {
            const dvec3 ray = test::rayThrough(view, static_cast<double>(i % view.width) + 0.5,
                                               static_cast<double>(i / view.width) + 0.5);
            bool isMet = false, isOneOfThem = false;
            for (const reference::Disc& d : discs) {
                const dvec3 toDisc = d.position - view.eye;
                const double t = glm::dot(d.normal, toDisc) / glm::dot(d.normal, ray), most = 1.001 * d.radius;
                const dvec3 off = t * ray - toDisc;
                if (!(t > 0) || glm::dot(off, off) > most * most) continue;
                isMet = true;
                isOneOfThem |= (image.rgba[i] & 255u) == (d.colour.r > 0.5 ? 255u : 0u);
            }
            if (!isMet || !(image.depth[i] > 0)) continue;
            ++covered;
            unlike += image.rgba[i] != truth.rgba[i];
            wrong += !isOneOfThem;
        }
        printf("%s: %zu pixels of %zu show another of the equally deep than fp64 does\n", name.c_str(), unlike,
               covered);
        EXPECT_GT(covered, 8'000u);
        EXPECT_EQ(wrong, 0u) << name;
        if (name == "fp64") continue;
        EXPECT_GT(unlike, covered / 1000) << name << ": else this says nothing";
        const render::Image other = test::renderView(leant, *backend, *executor, view, settings);
        size_t otherUnlike = 0;
        for (size_t i = 0; i < other.rgba.size(); ++i) otherUnlike += other.rgba[i] != truthOfLeant.rgba[i];
        EXPECT_LE(otherUnlike, covered / 1000) << name;
    }
}

TEST(Splats, LeaveNoHolesInClosedSurfaces) {
    size_t holes = 0, looked = 0, ofPoints = 0;
    test::forViewsOfAClosedSurface(60, 128, -0.7, [&](const test::InsideView& v) {
        holes += v.openIn(test::drawnAs(render::Mode::splat, v.errorPixels));
        ofPoints += v.openIn(test::drawnAs(render::Mode::points, v.errorPixels));
        looked += v.pixels.size();
    });
    std::printf("%zu pixels inside outlines: %zu holes, of points %zu\n", looked, holes, ofPoints);
    EXPECT_GT(looked, 50'000u);
    EXPECT_EQ(holes, 0u);
    EXPECT_GT(ofPoints, looked / 10);
}

TEST(Splats, AreTheSameBytesForAnyThreads) { test::expectSameForAnyThreads(splats()); }

TEST(Splats, ThousandsAtOnePixelAreAsOne) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Rng rng(4);
    std::vector<test::TestPoint> points;
    for (int i = 0; i < 10'000; ++i)
        points.push_back({{rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), 0}, {0, 0, 1}, 0x303030u, 0.3f});
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor, 16384);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.width = view.height = 100;
    view.focalPixels = 300;
    const std::vector<double> middle = frontOf(test::leafDiscs(*store), view);
    ASSERT_GT(std::count_if(middle.begin(), middle.end(), [](double z) { return z > 0; }), 9000);
    render::FrameSettings settings = splats();
    settings.draw.lit = false;
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const render::Image image = test::renderView(store, *backend, *executor, view, settings);
        size_t wrong = 0;
        for (size_t i = 0; i < middle.size(); ++i)
            wrong += middle[i] > 0 && ((image.rgba[i] & 0xffffffu) != 0x303030u || std::abs(image.depth[i] - 3) > 1e-4);
        EXPECT_EQ(wrong, 0u) << name;
    }
}

}  // namespace
}  // namespace stipple
