// Mode surface: where it is exactly as mode splat (depth and coverage bit by bit, so that whatever holds for those
// holds here), its colours and normals those of the surface and not of single discs; nothing of that where discs are
// small.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "tests/support/curves.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/meshes.h"
#include "tests/support/mode_checks.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec3;
using render::Mode;

/// Near and far, parallel, from within the discs.
std::vector<lod::View> viewsOf(const lod::Store& store) {
    std::vector<lod::View> out;
    for (const double distance : {4.0, 0.8, 0.35, 0.2}) out.push_back(test::lookAt(store, 30, 25, distance, 300));
    out.push_back(out[1]);
    const double away = glm::length(out[1].eye);
    out.back().isOrthographic = true;
    out.back().focalPixels /= away;
    return out;
}
bool hasPass(const render::Backend& backend, const char* name) {
    const auto& times = backend.passTimes();
    return std::any_of(times.begin(), times.end(), [&](const auto& t) { return t.name == name; });
}

TEST(SurfaceMode, IsWhereSplatIs) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    test::writePly(folder / "a.ply", test::samplesOf(test::Shape::statue, 6'000, 3));
    const auto points = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    test::MeshRecipe rock;
    rock.grow.kind = "rock";
    rock.grow.triangles = 20'000;
    const std::vector<render::PlacedStore> placed{
        {points, {}, {}},
        {test::growMeshStore(rock, folder / "b.stipple", *executor), {}, {}},
        {test::buildCurves(test::curls({}), folder / "c.stipple", *executor), {}, {}}};
    size_t drawn = 0, changed = 0;
    for (const lod::View& view : viewsOf(*points))
        for (const double tau : {1e-4, 2.0}) {
            const render::Image splat = test::draw(placed, *backend, *executor, view, test::drawnAs(Mode::splat, tau)),
                                pull =
                                    test::draw(placed, *backend, *executor, view, test::drawnAs(Mode::pullpush, tau)),
                                surface =
                                    test::draw(placed, *backend, *executor, view, test::drawnAs(Mode::surface, tau));
            EXPECT_TRUE(surface.depth == splat.depth) << "the same bytes";
            EXPECT_FALSE(pull.depth == splat.depth) << "the control";
            for (size_t i = 0; i < splat.rgba.size(); ++i) {
                drawn += splat.depth[i] > 0;
                changed += splat.rgba[i] != surface.rgba[i];
                EXPECT_EQ(splat.rgba[i] >> 24, surface.rgba[i] >> 24);
            }
        }
    EXPECT_GT(drawn, 200'000u);
    EXPECT_GT(changed, drawn / 20) << "colours are not splat's";
}

// From afar nothing is smooth: there is no pass for it, and the picture is splat's.
TEST(SurfaceMode, IsSplatWhereDiscsAreSmall) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writePly(folder / "a.ply", test::samplesOf(test::Shape::statue, 6'000, 3));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    for (const auto& [distance, isNear] : {std::pair{3.0, false}, {0.6, true}}) {
        const auto backend = cpu::makeCpuBackend(*executor);
        const lod::View view = test::lookAt(*store, 30, 25, distance, 300);
        const render::Image splat = test::renderView(store, *backend, *executor, view, test::drawnAs(Mode::splat)),
                            surface = test::renderView(store, *backend, *executor, view, test::drawnAs(Mode::surface));
        EXPECT_EQ(hasPass(*backend, "smooth"), isNear);
        EXPECT_EQ(surface.rgba == splat.rgba, !isNear);
        EXPECT_EQ(surface.normal == splat.normal, !isNear);
    }
}

/// A sphere of radius 1 whose colours are linear in its places.
std::vector<test::TestPoint> colouredSphere(size_t count) {
    std::vector<test::TestPoint> out(count);
    for (size_t i = 0; i < count; ++i) {  // even, and nowhere in rows (a Fibonacci lattice)
        const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(count),
                     a = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
        out[i].position = {r * std::cos(a), r * std::sin(a), z};
        out[i].normal = glm::vec3(out[i].position);
        const auto byte = [](double c) { return static_cast<uint32_t>(std::lround(255 * (0.5 + 0.4 * c))); };
        out[i].colour = byte(out[i].position.x) | byte(out[i].position.y) << 8 | byte(z) << 16;
    }
    return out;
}

// Normals and colours of wide discs against those of the surface that they stand on.
TEST(SurfaceMode, ShowsTheSurfaceAndNotItsDiscs) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    test::writePly(folder / "a.ply", colouredSphere(2'000));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const lod::View view = test::lookAt(*store, 30, 25, 0.8, 500);
    struct Off {
        double normal = 0, colour = 0;
    };
    const auto measure = [&](Mode mode) {
        const render::Image image =
            test::renderView(store, *backend, *executor, view, test::drawnAs(mode, 1e-4, false));
        Off off;
        double seen = 0;
        for (size_t i = 0; i < image.depth.size(); ++i) {
            if (!(image.depth[i] > 0)) continue;
            const dvec3 ray(double(i % 500) + 0.5 - 250, double(i / 500) + 0.5 - 250, view.focalPixels);
            const dvec3 at = view.eye + double(image.depth[i]) / view.focalPixels *
                                            (ray.x * view.right + ray.y * view.down + ray.z * view.forward);
            const dvec3 truth = glm::normalize(at);
            // Where the outline is far.
            if (glm::dot(truth, glm::normalize(view.eye - at)) < 0.5) continue;
            const dvec3 n(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            off.normal += std::acos(std::clamp(glm::dot(truth, n), -1.0, 1.0)) * 180 / 3.14159265358979;
            for (int c = 0; c < 3; ++c)
                off.colour += std::abs((image.rgba[i] >> 8 * c & 255u) - 255 * (0.5 + 0.4 * truth[c])) / 3;
            ++seen;
        }
        EXPECT_GT(seen, 50'000);
        std::printf("%-9s normals %.2f degrees off in the mean, colours %.2f of 255\n",
                    render::reconstructionOf(mode).name, off.normal / seen, off.colour / seen);
        return Off{off.normal / seen, off.colour / seen};
    };
    const Off surface = measure(Mode::surface), splat = measure(Mode::splat), pull = measure(Mode::pullpush);
    EXPECT_LE(surface.normal, 0.4 * splat.normal) << "splat is the control: each disc a facet";
    EXPECT_LE(surface.colour, 0.4 * splat.colour);
    EXPECT_LE(surface.normal, 1.05 * pull.normal);
    EXPECT_LE(surface.colour, 1.05 * pull.colour);
}

// Discs of more than 32 px, which the pyramid has as means of those about the front one.
TEST(SurfaceMode, ShowsNoFacetsFromNear) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    test::writePly(folder / "a.ply", colouredSphere(600));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::lookAt(*store, 30, 25, 0.8, 400);
    view.eye *= 1.6 / glm::length(view.eye);
    // Neighbours in a row whose normals are more than 2 degrees apart.
    const auto jumps = [&](Mode mode) {
        const render::Image image = test::renderView(store, *backend, *executor, view, test::drawnAs(mode));
        size_t n = 0;
        for (size_t i = 1; i < image.depth.size(); ++i) {
            const glm::vec3 a(image.normal[3 * i - 3], image.normal[3 * i - 2], image.normal[3 * i - 1]),
                b(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            n += i % 400 > 0 && image.depth[i] > 0 && image.depth[i - 1] > 0 && glm::dot(a, b) < 0.99939f;
        }
        return n;
    };
    const size_t surface = jumps(Mode::surface), splat = jumps(Mode::splat);
    std::printf("jumps of normals: surface %zu, splat %zu\n", surface, splat);
    EXPECT_LE(surface, splat / 10) << "splat is the control";
    EXPECT_GT(splat, 1'000u);
}

// Of discs that do not reach each other none is lost, though rays of pixels' centres miss most of them.
TEST(SurfaceMode, ShowsWhatStandsAloneAtASlant) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    std::vector<test::TestPoint> points;
    for (int i = 0; i < 3'600; ++i) {
        const double x = 1.67 * (i % 60 - 30) + 0.1 * std::sin(7.0 * i),
                     y = 1.67 * (i / 60 - 30) + 0.1 * std::sin(5.0 * i);
        points.push_back({{x, y, 0}, {0.906f, 0, 0.423f}, 0xffffff, 0.118f});
    }
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.eye = {0, 0, 100};
    view.isOrthographic = true;
    view.width = view.height = 640;
    view.focalPixels = 6.4;
    for (const Mode mode : {Mode::surface, Mode::splat, Mode::pullpushExact}) {
        const render::Image image = test::renderView(store, *backend, *executor, view, test::drawnAs(mode));
        const auto drawn = std::count_if(image.depth.begin(), image.depth.end(), [](float z) { return z > 0; });
        EXPECT_GE(drawn, 3'590) << render::reconstructionOf(mode).name;
    }
}

TEST(SurfaceMode, IsTheSameBytesForAnyThreads) { test::expectSameForAnyThreads(test::drawnAs(Mode::surface)); }

TEST(SurfaceMode, LeavesNoHolesInClosedSurfaces) {
    size_t holes = 0, looked = 0;
    test::forViewsOfAClosedSurface(60, 128, -0.7, [&](const test::InsideView& v) {
        holes += v.openIn(test::drawnAs(Mode::surface, v.errorPixels));
        looked += v.pixels.size();
    });
    EXPECT_GT(looked, 50'000u);
    EXPECT_EQ(holes, 0u);
}

}  // namespace
}  // namespace stipple
