// Mode ewa: against the brute force of the fp64 restatement, and against what it is for: constant colours stay
// constant, surfaces closed, textures filtered, silhouettes without what is behind them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/drawn_discs.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/meshes.h"
#include "tests/support/mode_checks.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using glm::dvec2;
using glm::dvec3;

render::FrameSettings blended(render::Mode mode = render::Mode::ewa) { return test::drawnAs(mode, 1e-4, false); }

double coverageOf(const render::Image& image, size_t pixel) { return (image.rgba[pixel] >> 24) / 255.0; }
double channel(const render::Image& image, size_t pixel, int c) {
    return static_cast<double>(image.linear[3 * pixel + static_cast<size_t>(c)]);
}

/// Pixels that are not alike: of what is there, coverage, depth, normals, colours.
struct Apart {
    size_t drawn = 0, coverage = 0, depth = 0, normal = 0, colour = 0;
};
Apart compare(const render::Image& a, const render::Image& b) {
    Apart out;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        const bool isDrawn = b.depth[i] > 0;
        out.drawn += isDrawn;
        out.coverage += std::abs(coverageOf(a, i) - coverageOf(b, i)) > 2.5 / 255;
        for (int c = 0; c < 3; ++c)
            if (std::abs(static_cast<int>(a.rgba[i] >> (8 * c) & 255) - static_cast<int>(b.rgba[i] >> (8 * c) & 255)) >
                4) {
                ++out.colour;
                break;
            }
        if (!isDrawn || a.depth[i] <= 0) continue;
        out.depth += std::abs(a.depth[i] / b.depth[i] - 1) > 1e-3f;
        const auto normal = [&](const render::Image& image) {
            return glm::vec3(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
        };
        out.normal += glm::dot(normal(a), normal(b)) < 0.9998f;
    }
    return out;
}

TEST(Ewa, IsWhatTheBruteForceSays) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto oracle = reference::makeReferenceBackend(*executor);
    test::writePly(folder / "a.ply", test::anyDiscs(3000, 5), true, true);
    test::writePly(folder / "b.ply", test::samplesOf(test::Shape::statue, 20'000, 3));
    struct Look {
        dvec3 eye;
        double focal;
        bool isOrthographic = false;
    };
    for (const char* name : {"a", "b"}) {
        const auto store = test::buildAndOpen(folder / (std::string(name) + ".ply"),
                                              folder / (std::string(name) + ".stipple"), *executor);
        for (const Look& look : {Look{{0.2, 0.1, 3.5}, 300},
                                 {{0.1, 0.05, name == std::string("a") ? 0.3 : 1.35}, 120},
                                 {{-0.6, 0.9, 1.6}, 60},
                                 {{0, 0.1, 60}, 4000},
                                 {{0.1, 0.1, 3}, 80, true}})
            for (const double tau : {1e-4, 4.0}) {
                lod::View view = test::viewFromAbove({0, 0, 0});
                view.eye = look.eye;
                view.focalPixels = look.focal;
                view.isOrthographic = look.isOrthographic;
                view.width = 201;
                view.height = 151;
                view.nearPlane = 1e-6;
                render::FrameSettings settings = blended();
                settings.budgets.errorPixels = tau;
                const render::Image truth = test::renderView(store, *oracle, *executor, view, settings);
                for (auto& [backendName, backend] : test::cpuBackendsAndOracle(*executor)) {
                    if (backendName == "fp64") continue;
                    SCOPED_TRACE(testing::Message()
                                 << name << " " << backendName << " from " << look.eye.z << ", tau " << tau);
                    const render::Image image = test::renderView(store, *backend, *executor, view, settings);
                    const Apart apart = compare(image, truth);
                    const size_t few = apart.drawn / 1000;
                    EXPECT_GT(apart.drawn, 1'000u);
                    EXPECT_LE(apart.coverage, few);
                    EXPECT_LE(apart.depth, few);
                    EXPECT_LE(apart.normal, few);
                    EXPECT_LE(apart.colour, few);
                    EXPECT_GE(test::drawnPsnr(image, truth), 50);
                    // The control: another mode is another picture.
                    settings.mode = render::Mode::splat;
                    const render::Image other = test::renderView(store, *backend, *executor, view, settings);
                    settings.mode = render::Mode::ewa;
                    if (name == std::string("a")) EXPECT_GT(compare(other, truth).colour, apart.drawn / 20);
                }
            }
    }
}

/// Discs before, behind and in a mesh: what is in front is there, on every backend.
TEST(Ewa, StandsBeforeAndBehindTriangles) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::MeshRecipe rock;
    rock.grow.kind = "rock";
    rock.grow.triangles = 5'000;
    rock.isTextured = false;
    const auto mesh = test::growMeshStore(rock, folder / "m.stipple", *executor);
    const dvec3 middle = 0.5 * (mesh->description.boundsMin + mesh->description.boundsMax);
    const double size = glm::length(mesh->description.boundsMax - mesh->description.boundsMin);
    std::vector<test::TestPoint> points;
    for (int y = -60; y <= 60; ++y)
        for (int x = -60; x <= 60; ++x)
            points.push_back(
                {middle + 0.006 * size * dvec3(x, y, 0.5 * x), glm::normalize(glm::vec3(-0.5, 0, 1)), 0x0000ffu});
    test::writePly(folder / "a.ply", points);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const lod::View view = test::fitView(*mesh, 240, 200);
    const auto oracle = reference::makeReferenceBackend(*executor);
    const auto draw = [&](render::Backend& backend, std::vector<render::PlacedStore> placed) {
        const auto state = render::makeFrameState(placed, backend, *executor, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view, blended()));
        return state->image;
    };
    const render::Image truth = draw(*oracle, {{mesh, {}, {}}, {store, {}, {}}}),
                        alone = draw(*oracle, {{mesh, {}, {}}});
    // Both kinds are seen: the plane cuts the rock.
    size_t before = 0, rock_ = 0;
    for (size_t i = 0; i < truth.depth.size(); ++i) {
        before += truth.depth[i] > 0 && alone.depth[i] > 0 && truth.depth[i] < 0.999f * alone.depth[i];
        rock_ += truth.depth[i] > 0 && truth.depth[i] == alone.depth[i];
    }
    EXPECT_GT(before, 1'000u);
    EXPECT_GT(rock_, 1'000u);
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        if (name == "fp64") continue;
        const Apart apart = compare(draw(*backend, {{mesh, {}, {}}, {store, {}, {}}}), truth);
        EXPECT_LE(apart.coverage, apart.drawn / 500) << name;
        EXPECT_LE(apart.depth, apart.drawn / 500) << name;
        EXPECT_LE(apart.colour, apart.drawn / 500) << name;
    }
}

/// A plane of square cells, seen from (0, 0, 3) or aslant; colours by `colourAt`.
template <typename ColourAt>
std::vector<test::TestPoint> plane(int half, double step, double jitter, const ColourAt& colourAt) {
    Rng rng(9);
    std::vector<test::TestPoint> points;
    for (int y = -half; y <= half; ++y)
        for (int x = -half; x <= half; ++x) {
            const double px = (x + 0.5 + rng.uniform(-jitter, jitter)) * step,
                         py = (y + 0.5 + rng.uniform(-jitter, jitter)) * step;
            points.push_back({{px, py, 0}, {0, 0, 1}, colourAt(px, py)});
        }
    return points;
}

TEST(Ewa, OneColourStaysOneColour) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    for (const double jitter : {0.0, 0.3, 0.5}) {
        test::writePly(folder / "a.ply", plane(80, 0.0125, jitter, [](double, double) { return 0x4080c0u; }));
        const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
        for (const double distance : {1.0, 3.0, 12.0})
            for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
                lod::View view = test::viewFromAbove({0, 0, 0});
                view.eye.z = distance;
                view.width = view.height = 120;
                const render::Image image = test::renderView(store, *backend, *executor, view, blended());
                size_t off = 0, inside = 0;
                for (size_t i = 0; i < image.rgba.size(); ++i) {
                    const double x = distance * (double(i % 120) - 59.5) / view.focalPixels,
                                 y = distance * (double(i / 120) - 59.5) / view.focalPixels;
                    if (std::max(std::abs(x), std::abs(y)) > 0.95) continue;
                    ++inside;
                    for (int c = 0; c < 3; ++c)
                        off += std::abs(static_cast<int>(image.rgba[i] >> (8 * c) & 255) -
                                        static_cast<int>(0x4080c0u >> (8 * c) & 255)) > 1 ||
                               std::abs(double{image.depth[i]} - distance) > 1e-4 * distance;
                }
                EXPECT_GT(inside, 100u);
                EXPECT_EQ(off, 0u) << name << ", jitter " << jitter << ", from " << distance;
            }
    }
}

/// Without a low-pass discs of a twentieth of a pixel weigh nothing at the centres of pixels: those that hold them have
/// their depths and normals all the same.
TEST(Ewa, DiscsThatWeighNothingHaveTheirOwnNormals) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::vector<test::TestPoint> points;
    for (int y = -80; y <= 80; ++y)
        for (int x = -80; x <= 80; ++x) points.push_back({{x / 128.0, y / 128.0, 0}, {0, 0, 1}, 0x00ff00u, 0.01f});
    const size_t wall = points.size();
    for (int y = -4; y <= 4; ++y)
        for (int x = -4; x <= 4; ++x)
            points.push_back({{x / 16.0, y / 16.0 + 0.002, 1}, {0.6f, 0, 0.8f}, 0x0000ffu, 0.0003f});
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.width = view.height = 101;
    view.focalPixels = 300;
    render::FrameSettings settings = blended();
    settings.draw.lowPass = 0;
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const render::Image image = test::renderView(store, *backend, *executor, view, settings);
        for (size_t i = wall; i < points.size(); ++i) {
            const dvec3 p = points[i].position;
            SCOPED_TRACE(testing::Message() << name << ": a disc at " << p.x << ", " << p.y);
            const size_t at = static_cast<size_t>(50.5 - 150 * p.y) * 101 + static_cast<size_t>(50.5 + 150 * p.x);
            EXPECT_NEAR(image.depth[at], 2, 0.01);
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(image.normal[3 * at + static_cast<size_t>(c)], points[i].normal[c], 1e-3);
        }
    }
}

TEST(Ewa, LeavesNoHolesInClosedSurfaces) {
    size_t holes = 0, clear = 0, looked = 0;
    test::forViewsOfAClosedSurface(60, 128, -0.7, [&](const test::InsideView& v) {
        const render::Image image = v.draw(test::drawnAs(render::Mode::ewa, v.errorPixels, false));
        for (const size_t i : v.pixels) {
            holes += image.rgba[i] >> 24 == 0;
            clear += image.rgba[i] >> 24 < 255;
        }
        looked += v.pixels.size();
    });
    std::printf("%zu pixels inside outlines: %zu holes, %zu not covered wholly\n", looked, holes, clear);
    EXPECT_GT(looked, 50'000u);
    EXPECT_EQ(holes, 0u);
    EXPECT_LE(clear, looked / 20'000);  // two pixels from the outline a dent of the samples' own may be
}

/// A red leaf before a green wall, both before a blue sky: inside the outline of the wall nothing of the sky is seen,
/// neither along the leaf's rim nor where that crosses the wall's.
TEST(Ewa, NoSkyShinesThroughTheRimOfALeafBeforeAWall) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    std::vector<test::TestPoint> points, leaf;
    for (int y = -100; y <= 100; ++y)
        for (int x = -100; x <= 100; ++x) {
            if (x <= 0) points.push_back({{0.01 * x, 0.01 * y, 0}, {0, 0, 1}, 0x00ff00u});
            if (x * x + y * y > 1600) continue;
            points.push_back({{0.01 * x, 0.01 * y, 0.5}, {0, 0, 1}, 0x0000ffu});
            leaf.push_back(points.back());
        }
    test::writePly(folder / "a.ply", points);
    test::writePly(folder / "b.ply", leaf);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const auto leafAlone = test::buildAndOpen(folder / "b.ply", folder / "b.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.focalPixels = 420;
    render::FrameSettings settings = blended();
    settings.draw.background = {0, 0, 1};
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const render::Image image = test::renderView(store, *backend, *executor, view, settings);
        // The control: without the wall the sky is seen through the same rim.
        const render::Image alone = test::renderView(leafAlone, *backend, *executor, view, settings);
        size_t blue = 0, inside = 0, soft = 0, rim = 0, blueRim = 0, blueRimAlone = 0;
        for (size_t i = 0; i < image.rgba.size(); ++i) {
            soft += coverageOf(image, i) > 0.05 && coverageOf(image, i) < 0.95;
            const dvec3 ray = test::rayThrough(view, double(i % 400) + 0.5, double(i / 400) + 0.5);
            const dvec3 wall = view.eye + 3.0 * ray, onPlane = view.eye + 2.5 * ray;
            // Three pixels within the outline of both together.
            const bool onLeaf = glm::length(dvec2(onPlane)) < 0.38;
            const bool onWall = wall.x < -0.02 && wall.x > -0.98 && std::abs(wall.y) < 0.98;
            if (onWall && std::abs(glm::length(dvec2(onPlane)) - 0.405) < 0.015) {
                ++rim;
                blueRim += channel(image, i, 2) > 1e-6;
                blueRimAlone += channel(alone, i, 2) > 0.05 && channel(alone, i, 0) > 0.05;
            }
            if (!onLeaf && !onWall) continue;
            ++inside;
            blue += channel(image, i, 2) > 1e-6;
        }
        EXPECT_GT(inside, 40'000u);
        EXPECT_GT(soft, 200u) << name;  // outlines against the sky are soft
        EXPECT_EQ(blue, 0u) << name;
        EXPECT_GT(rim, 500u);
        EXPECT_EQ(blueRim, 0u) << name;
        EXPECT_GT(blueRimAlone, 100u) << name;
    }
}

/// A checker seen aslant, to its horizon: against what a Gaussian of the pixel and of the samples sees of it.
TEST(Ewa, FiltersACheckerPlane) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    constexpr double kStep = 0.01, kCell = 0.16;
    const auto isWhite = [&](double x, double y) {
        return (static_cast<long>(std::floor(x / kCell)) + static_cast<long>(std::floor(y / kCell))) % 2 == 0;
    };
    test::writePly(folder / "a.ply",
                   plane(300, kStep, 0, [&](double x, double y) { return isWhite(x, y) ? 0xffffffu : 0u; }));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.eye = {0, -3.2, 0.8};
    view.forward = glm::normalize(dvec3(0, 1, -0.35));
    view.right = {1, 0, 0};
    view.down = glm::cross(view.forward, view.right);
    view.width = 160;
    view.height = 120;
    view.focalPixels = 150;
    // The truth: rays about each pixel by the low-pass, places about their hits by the samples' own kernel.
    const double sigma = 0.685 * kStep;
    std::vector<double> truth(size_t{160} * 120, -1);
    std::vector<double> nodes, few;
    for (int k = -7; k < 7; ++k) nodes.push_back(0.4 * (k + 0.5));
    for (int k = -3; k < 3; ++k) few.push_back(0.9 * (k + 0.5));
    for (size_t i = 0; i < truth.size(); ++i) {
        double sum = 0, weights = 0;
        bool isAll = true;
        for (const double u : nodes)
            for (const double v : nodes) {
                const double w = std::exp(-0.5 * (u * u + v * v));
                const dvec3 ray = test::rayThrough(view, double(i % 160) + 0.5 + std::sqrt(0.5) * u,
                                                   double(i / 160) + 0.5 + std::sqrt(0.5) * v);
                const double t = -view.eye.z / ray.z;
                const dvec3 at = view.eye + t * ray;
                if (!(t > 0) || std::max(std::abs(at.x), std::abs(at.y)) > 2.8) {
                    isAll = false;
                    continue;
                }
                for (const double a : few)
                    for (const double b : few) {
                        const double k = w * std::exp(-0.5 * (a * a + b * b));
                        sum += isWhite(at.x + sigma * a, at.y + sigma * b) ? k : 0;
                        weights += k;
                    }
            }
        if (isAll) truth[i] = sum / weights;
    }
    const auto error = [&](render::Mode mode, render::Backend& backend) {
        render::FrameSettings settings = blended(mode);
        settings.draw.kernelSupport = 3;
        const render::Image image = test::renderView(store, backend, *executor, view, settings);
        double squared = 0;
        size_t n = 0;
        for (size_t i = 0; i < truth.size(); ++i) {
            if (truth[i] < 0) continue;
            const double off = channel(image, i, 1) - truth[i];
            squared += off * off;
            ++n;
        }
        EXPECT_GT(n, 8'000u);
        return -10 * std::log10(squared / static_cast<double>(n));
    };
    const auto backend = cpu::makeCpuBackend(*executor);
    const double ewa = error(render::Mode::ewa, *backend), splat = error(render::Mode::splat, *backend),
                 pullpush = error(render::Mode::pullpush, *backend);
    std::printf("checker: ewa %.1f dB, splat %.1f dB, pullpush %.1f dB\n", ewa, splat, pullpush);
    EXPECT_GE(ewa, 35);
    EXPECT_LT(splat, 30);
}

/// Pans by a sixteenth of a pixel: how much pixels inside the plane change.
TEST(Ewa, FlickersLessThanSplat) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    Rng rng(11);
    test::writePly(folder / "a.ply", plane(150, 0.01, 0.3, [&](double, double) {
                       return static_cast<uint32_t>(rng.below(256)) * 0x010101u;
                   }));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    const auto flicker = [&](render::Mode mode) {
        render::Image before;
        double sum = 0;
        for (int k = 0; k < 9; ++k) {
            lod::View view = test::viewFromAbove({0, 0, 0});
            view.width = view.height = 100;
            view.focalPixels = 300;  // a spacing a pixel
            view.eye.x = k * 3.0 / 300 / 16;
            render::Image image = test::renderView(store, *backend, *executor, view, blended(mode));
            for (size_t i = 0; k > 0 && i < image.rgba.size(); ++i) {
                const double off = channel(image, i, 1) - channel(before, i, 1);
                sum += off * off;
            }
            before = std::move(image);
        }
        return std::sqrt(sum / (8 * 10'000));
    };
    const double ewa = flicker(render::Mode::ewa), splat = flicker(render::Mode::splat);
    std::printf("change by a pan of 1/16 px: ewa %.4f, splat %.4f\n", ewa, splat);
    EXPECT_LE(ewa, splat / 4);
}

TEST(Ewa, IsTheSameBytesForAnyThreads) { test::expectSameForAnyThreads(blended()); }

/// Lists that do not fit at once are drawn some rows of tiles after others: the same bytes.
TEST(Ewa, TilesInBandsAreTheSameBytes) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::samplesOf(test::Shape::statue, 20'000, 3));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.eye = {0.1, 0.05, 2};
    view.width = 230;
    view.height = 190;
    const auto whole = cpu::makeCpuBackend(*executor);
    for (const render::Mode mode : {render::Mode::ewa, render::Mode::splat}) {
        const render::Image truth = test::renderView(store, *whole, *executor, view, blended(mode));
        size_t drawn = 0;
        for (const float depth : truth.depth) drawn += depth > 0;
        EXPECT_GT(drawn, 10'000u);
        // One row of tiles after the other; some at a time. Each of 20,000 discs is in one list at least.
        for (const uint64_t most : {1u, 3'000u}) {
            const auto bands = cpu::makeCpuBackend(*executor, nullptr, most);
            const render::Image image = test::renderView(store, *bands, *executor, view, blended(mode));
            EXPECT_EQ(image.rgba, truth.rgba) << most;
            EXPECT_EQ(image.depth, truth.depth) << most;
            EXPECT_EQ(image.normal, truth.normal) << most;
        }
    }
}

/// Normals are blended only where somebody reads them: the picture is the same.
TEST(Ewa, PicturesDoNotDependOnWhatElseIsAskedFor) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::samplesOf(test::Shape::statue, 20'000, 3));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view = test::viewFromAbove({0, 0, 0});
    view.eye = {0.1, 0.05, 2};
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor))
        for (const bool isLit : {false, true})
            for (const uint32_t debug : {shared::kDebugNone, shared::kDebugNormals}) {
                render::FrameSettings settings = blended();
                settings.draw.lit = isLit;
                settings.draw.debugView = debug;
                const render::Image all = test::renderView(store, *backend, *executor, view, settings);
                settings.wantDepthAndNormal = false;
                const render::Image picture = test::renderView(store, *backend, *executor, view, settings);
                EXPECT_EQ(picture.rgba, all.rgba) << name << (isLit ? ", lit" : "") << ", debug view " << debug;
                settings.draw.debugView = shared::kDebugNormals;
                settings.draw.lit = false;
                const render::Image other = test::renderView(store, *backend, *executor, view, settings);
                EXPECT_EQ(other.rgba == all.rgba, debug == shared::kDebugNormals) << name;
            }
}

TEST(Ewa, ThousandsAtOnePixelAreAsOne) {
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
    for (auto& [name, backend] : test::cpuBackendsAndOracle(*executor)) {
        const render::Image image = test::renderView(store, *backend, *executor, view, blended());
        size_t wrong = 0;
        for (size_t i = 0; i < image.rgba.size(); ++i) {
            const double x = (double(i % 100) - 49.5) / 100, y = (double(i / 100) - 49.5) / 100;
            if (std::max(std::abs(x), std::abs(y)) > 0.45) continue;
            const auto grey = static_cast<int>(image.rgba[i] & 255);
            wrong +=
                std::abs(grey - 0x30) > 1 || std::abs(double{image.depth[i]} - 3) > 1e-3 || image.rgba[i] >> 24 != 255;
        }
        EXPECT_EQ(wrong, 0u) << name;
    }
}

}  // namespace
}  // namespace stipple
