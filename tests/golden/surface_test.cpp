// What the reconstruction says of a surface (depth, normal, coverage) against rays: the plane itself, by one division
// in fp64, and the discs of the store, traced. Neither knows of pyramids, slopes or ellipses on an image.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;

constexpr double kSpacing = 0.01;

/// A square of a plane through the origin with unit normal `n`, jittered samples kSpacing apart.
std::vector<test::TestPoint> plane(const dvec3& n, int edge, double radius, uint64_t seed) {
    const dvec3 u = glm::normalize(glm::cross(std::abs(n.x) < 0.9 ? dvec3(1, 0, 0) : dvec3(0, 1, 0), n)),
                v = glm::cross(n, u);
    Rng rng(seed);
    std::vector<test::TestPoint> points;
    for (int y = 0; y < edge; ++y)
        for (int x = 0; x < edge; ++x) {
            const double a = x - 0.5 * edge + 0.4 * rng.uniform(-1, 1), b = y - 0.5 * edge + 0.4 * rng.uniform(-1, 1);
            points.push_back({(u * a + v * b) * kSpacing, glm::vec3(n), 0xc0c0c0, static_cast<float>(radius)});
        }
    return points;
}

/// Looks along +z from `distance` before the origin, with a principal point in the middle.
lod::View viewFrom(double distance, double focal, uint32_t width, uint32_t height) {
    lod::View view;
    view.eye = {0, 0, -distance};
    view.right = {1, 0, 0};
    view.down = {0, 1, 0};
    view.forward = {0, 0, 1};
    view.focalPixels = focal;
    view.width = width;
    view.height = height;
    return view;
}
dvec3 rayOf(const lod::View& view, size_t pixel) {
    const double x = static_cast<double>(pixel % view.width) + 0.5, y = static_cast<double>(pixel / view.width) + 0.5;
    return {(x - 0.5 * view.width) / view.focalPixels, (y - 0.5 * view.height) / view.focalPixels, 1};
}

render::FrameSettings fullDetail() {
    render::FrameSettings settings;
    settings.budgets.errorPixels = 1e-4;
    settings.wantDepthAndNormal = true;
    return settings;
}

struct Apart {
    double mean = 0, p99 = 0, worst = 0;
};
Apart summary(std::vector<double> values) {
    Apart a;
    if (values.empty()) return a;
    std::sort(values.begin(), values.end());
    for (const double v : values) a.mean += v / static_cast<double>(values.size());
    a.p99 = values[values.size() * 99 / 100];
    a.worst = values.back();
    return a;
}

std::vector<std::unique_ptr<render::Backend>> backends(Executor& executor) {
    std::vector<std::unique_ptr<render::Backend>> all;
    all.push_back(cpu::makeCpuBackend(executor));
    all.push_back(reference::makeReferenceBackend(executor));
    return all;
}

/// The depths and normals of a plane's image against the plane, by one division in fp64.
void expectThePlane(const render::Image& image, const render::Image& traced, const lod::View& view, const dvec3& n,
                    const std::string& name) {
    std::vector<double> depth, leaning;
    size_t missing = 0, seen = 0;
    for (size_t i = 0; i < image.depth.size(); ++i) {
        if (traced.depth[i] > 0) ++seen;
        if (image.depth[i] <= 0) missing += traced.depth[i] > 0;
        if (traced.depth[i] <= 0 || image.depth[i] <= 0) continue;
        const dvec3 ray = rayOf(view, i);
        const double z = -glm::dot(n, view.eye) / glm::dot(n, ray);  // (the plane goes through 0)
        // Planes that face the eye by less than 1/32 are drawn as if they did by that (splat.h, kGrazing).
        if (std::abs(glm::dot(n, glm::normalize(ray))) > 1.0 / 32)
            depth.push_back(std::abs(double{image.depth[i]} - z) * view.focalPixels / z);
        const dvec3 drawn(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
        leaning.push_back(std::asin(std::min(1.0, glm::length(glm::cross(drawn, n)))) * 180 / M_PI);
    }
    const Apart z = summary(depth), lean = summary(leaning);
    SCOPED_TRACE(name);
    std::printf("%-18s: depth mean %.4f p99 %.4f max %.3f px, normal p99 %.3f max %.3f deg, missing %zu of %zu\n",
                name.c_str(), z.mean, z.p99, z.worst, lean.p99, lean.worst, missing, seen);
    ASSERT_GT(seen, 1300u);
    EXPECT_LE(z.mean, 0.1);
    EXPECT_LE(z.p99, 1.0);
    EXPECT_LE(lean.worst, 0.5);
    EXPECT_LE(missing, seen / 200);
}

// (Samples 0.4 px apart have discs of less than a pixel: many pixels show one that their ray misses.)
TEST(Surface, DepthAndNormalsOfAPlaneAreThePlanesAtAnyAngle) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    int number = 0;
    for (const double degrees : {0.0, 60.0, 80.0, 85.0})
        for (const double perPixel : {0.4, 0.7, 2.5, 9.0}) {  // spacings of the samples, px
            SCOPED_TRACE(testing::Message() << degrees << " degrees, " << perPixel << " px between samples");
            std::printf("%.0f degrees, %.1f px between samples\n", degrees, perPixel);
            const double angle = degrees * M_PI / 180;
            // Leaning about an axis that is not the image's.
            const dvec3 n = glm::normalize(dvec3(0.8 * std::sin(angle), 0.6 * std::sin(angle), -std::cos(angle)));
            const std::string name = folder / std::to_string(number++);
            test::writePly(name + ".ply", plane(n, 300, 1.1 * kSpacing, 7), true, true);
            const auto store = test::buildAndOpen(name + ".ply", name + ".stipple", *executor);
            constexpr double kFocal = 300;
            const lod::View view = viewFrom(kFocal * kSpacing / perPixel, kFocal, 200, 160);
            const auto traced = reference::trace({{store, {}, {}}}, view, {1, {}}, *executor);
            ASSERT_TRUE(traced);
            for (const auto& backend : backends(*executor))
                for (const render::Mode mode : {render::Mode::pullpush, render::Mode::surface, render::Mode::splat}) {
                    render::FrameSettings settings = fullDetail();
                    settings.mode = mode;
                    expectThePlane(test::renderView(store, *backend, *executor, view, settings), *traced, view, n,
                                   backend->name() + " " + render::reconstructionOf(mode).name);
                }
        }
}

// Spacings of a clustered scan, of which many discs are less than a pixel, range over two orders. (Where nothing is met
// the pixels of discs that are missed end at their rims: in front of the plane, by what half a pixel is along it.)
TEST(Surface, DepthOfAClusteredPlaneIsThePlanesWhereItsDiscsAreMet) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Rng rng(3);
    const auto clustered = [&] { return std::pow(rng.uniform(-1, 1), 3) * 3; };
    std::vector<test::TestPoint> points(60'000);
    for (test::TestPoint& p : points) p = {{clustered(), clustered(), 0}, {0, 0, 1}, 0xc0c0c0, 0};
    test::writePly(folder / "a.ply", points, true, false);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    for (const double height : {1.0, 0.3, 0.1}) {
        lod::View view = viewFrom(0, 400, 320, 240);
        view.eye = {0, -4, height};
        view.forward = glm::normalize(-view.eye);
        view.right = {1, 0, 0};
        view.down = glm::cross(view.forward, view.right);
        const auto traced = reference::trace({{store, {}, {}}}, view, {1, {}}, *executor);
        ASSERT_TRUE(traced);
        for (const auto& backend : backends(*executor)) {
            render::FrameSettings settings = fullDetail();
            settings.mode = render::Mode::surface;
            const render::Image image = test::renderView(store, *backend, *executor, view, settings);
            std::vector<double> met, any;
            for (size_t i = 0; i < image.depth.size(); ++i) {
                const dvec3 r = rayOf(view, i), ray = r.x * view.right + r.y * view.down + view.forward;
                const double z = -height / ray.z;
                if (!(image.depth[i] > 0) || !(z > 0)) continue;
                const double apart = std::abs(double{image.depth[i]} - z) * view.focalPixels / z;
                any.push_back(apart);
                if (traced->depth[i] > 0) met.push_back(apart);
            }
            const Apart m = summary(met), a = summary(any);
            std::printf("height %.1f %-9s: met %zu, mean %.4f p99 %.4f max %.3f px; all %zu, mean %.4f p99 %.4f px\n",
                        height, backend->name().c_str(), met.size(), m.mean, m.p99, m.worst, any.size(), a.mean, a.p99);
            ASSERT_GT(met.size(), 500u);
            EXPECT_LE(m.mean, 0.1) << height;
            EXPECT_LE(m.p99, 1.0) << height;
        }
    }
}

TEST(Surface, AnEllipseIsTheDiscsAlsoInACornerOfTheView) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    int number = 0;
    for (const double lean : {0.0, 35.0, 60.0, 75.0})
        for (const double about : {0.0, 90.0, 200.0}) {
            SCOPED_TRACE(testing::Message() << lean << " degrees about " << about);
            // Off the axis by 43 degrees; the disc leans from the view to its centre.
            const dvec3 at = dvec3(0.8, 0.5, 1) * 10.0, v = glm::normalize(at);
            const dvec3 u = glm::normalize(glm::cross(dvec3(0, 1, 0), v)), w = glm::cross(v, u);
            const double a = lean * M_PI / 180, b = about * M_PI / 180;
            const dvec3 n = -v * std::cos(a) + (u * std::cos(b) + w * std::sin(b)) * std::sin(a);
            const std::string name = folder / std::to_string(number++);
            test::TestPoint disc{at, glm::vec3(n), 0xffffff, 1.0f}, far = disc;
            far.position = {0, 0, 4000};  // (a store of one point has no extent)
            test::writePly(name + ".ply", {disc, far}, true, true);
            const auto store = test::buildAndOpen(name + ".ply", name + ".stipple", *executor);
            const lod::View view = viewFrom(0, 200, 440, 320);
            const auto traced = reference::trace({{store, {}, {}}}, view, {1, {}}, *executor);
            ASSERT_TRUE(traced);
            for (const auto& backend : backends(*executor)) {
                const render::Image image = test::renderView(store, *backend, *executor, view, fullDetail());
                size_t both = 0, either = 0;
                for (size_t i = 0; i < image.depth.size(); ++i) {
                    const bool isTraced = traced->depth[i] > 0 && traced->depth[i]<100, isDrawn = image.depth[i]> 0 &&
                                          image.depth[i] < 100;
                    both += isTraced && isDrawn;
                    either += isTraced || isDrawn;
                }
                ASSERT_GT(either, 200u);
                EXPECT_GE(static_cast<double>(both) / static_cast<double>(either), 0.98) << backend->name();
            }
        }
}

// Splats whose centres are beside the picture or behind the eye reach into it, and a few of them fill it.
TEST(Surface, APlaneSeenFromNearIsThereToTheBorder) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    int number = 0;
    for (const double degrees : {0.0, 50.0, 80.0})
        for (const double spacings : {30.0, 10.0, 6.0, 4.0, 3.0, 0.8, 0.2}) {  // from the eye to the plane
            SCOPED_TRACE(testing::Message() << spacings << " spacings, " << degrees << " degrees");
            const double angle = degrees * M_PI / 180;
            const dvec3 n(std::sin(angle), 0, -std::cos(angle));
            const std::string name = folder / std::to_string(number++);
            test::writePly(name + ".ply", plane(n, 200, 1.3 * kSpacing, 11), true, true);
            const auto store = test::buildAndOpen(name + ".ply", name + ".stipple", *executor);
            lod::View view = viewFrom(spacings * kSpacing, 160, 160, 120);
            view.eye.x += 0.37 * kSpacing;
            view.nearPlane = 1e-12;
            const auto traced = reference::trace({{store, {}, {}}}, view, {1, {}}, *executor);
            ASSERT_TRUE(traced);
            for (const auto& backend : backends(*executor)) {
                const render::Image image = test::renderView(store, *backend, *executor, view, fullDetail());
                size_t covered = 0, both = 0, off = 0;  // off: in depth, by more than a percent
                for (size_t i = 0; i < image.depth.size(); ++i) {
                    covered += traced->depth[i] > 0;
                    if (!(traced->depth[i] > 0 && image.depth[i] > 0)) continue;
                    ++both;
                    const double z = -glm::dot(n, view.eye) / glm::dot(n, rayOf(view, i));
                    off += std::abs(image.depth[i] - z) > 0.01 * z;
                }
                ASSERT_GT(covered, image.depth.size() * (degrees > 60 ? 4 : 9) / 10);
                // (At 80 degrees much of the plane is far away, and splats there are seen nearly edge-on.)
                const double all = static_cast<double>(covered), some = static_cast<double>(both);
                EXPECT_GE(some, (degrees > 60 ? 0.995 : 0.998) * all) << backend->name();
                EXPECT_LE(static_cast<double>(off), (degrees > 60 ? 0.04 : 0.0005) * some) << backend->name();
            }
        }
}

// From near, of two surfaces the front one is seen where it is, and the other beside it: depth and colour against rays
// through the discs, which know neither lists nor means.
TEST(Surface, FromNearTheFrontOneOfTwoPlanesIsSeen) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::vector<test::TestPoint> points = plane({0, 0, -1}, 200, 1.3 * kSpacing, 11);
    for (test::TestPoint& p : points) p.colour = 0xff0000;
    std::vector<test::TestPoint> front = plane({0, 0, -1}, 200, 1.3 * kSpacing, 12);
    std::erase_if(front, [](const test::TestPoint& p) { return p.position.x > -0.7 * kSpacing; });
    for (test::TestPoint& p : front) {
        p.position.z = -kSpacing;
        p.colour = 0x00ff00;
        points.push_back(p);
    }
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    for (const double spacings : {2.5, 3.5}) {
        lod::View view = viewFrom(spacings * kSpacing, 160, 160, 120);
        view.nearPlane = 1e-12;
        const auto traced = reference::trace({{store, {}, {}}}, view, {1, {}}, *executor);
        ASSERT_TRUE(traced);
        for (const auto& backend : backends(*executor)) {
            SCOPED_TRACE(testing::Message() << backend->name() << ", " << spacings << " spacings");
            render::FrameSettings settings = fullDetail();
            settings.draw.lit = false;
            const render::Image image = test::renderView(store, *backend, *executor, view, settings);
            size_t wrong = 0, seenFront = 0;
            for (size_t i = 0; i < image.depth.size(); ++i) {
                const bool isFront = traced->depth[i] < (spacings - 0.5) * kSpacing;
                seenFront += isFront;
                const bool isDrawnGreen = (image.rgba[i] >> 8 & 255u) > (image.rgba[i] & 255u);
                wrong +=
                    std::abs(image.depth[i] - traced->depth[i]) > 0.01 * traced->depth[i] || isDrawnGreen != isFront;
            }
            EXPECT_GT(seenFront, image.depth.size() / 8);
            EXPECT_LT(seenFront, image.depth.size() * 3 / 4);
            EXPECT_LE(wrong, image.depth.size() / 200);
        }
    }
}

}  // namespace
}  // namespace stipple
