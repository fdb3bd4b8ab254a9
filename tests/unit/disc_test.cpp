// Points that stand alone: small discs, in the store and in the picture, and surfaces as closed as before.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/decode.h"
#include "engine/reference/reference.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// The radius of each leaf record's disc, and where it is.
std::vector<std::pair<glm::dvec3, double>> discsOf(const lod::Store& store) {
    std::vector<std::pair<glm::dvec3, double>> discs;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        const auto chunk = lod::readChunk(store, n);
        if (!chunk) continue;
        for (const shared::PointRecord& r : chunk->records) {
            const reference::Disc d = reference::decodeDisc(h, h.nodes[n], r);
            discs.emplace_back(d.position, d.radius);
        }
    }
    return discs;
}

TEST(Discs, APointAloneHasADiscLikeThoseAroundIt) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Rng rng(3);
    std::vector<test::TestPoint> points;
    // Sparse ground 1 m apart, on it a dense wall 2 cm apart, and strays beside the wall: one, and two together.
    for (int i = 0; i < 6400; ++i)
        points.push_back({{i % 80 + 0.3 * rng.uniform(-1, 1), i / 80 + 0.3 * rng.uniform(-1, 1), 0}});
    for (int i = 0; i < 20000; ++i)
        points.push_back({{40 + 0.02 * (i % 200) + 0.006 * rng.uniform(-1, 1), 40.5,
                           1.5 + 0.02 * (i / 200) + 0.006 * rng.uniform(-1, 1)}});
    const glm::dvec3 alone(42, 41.5, 2.5), first(41, 39.6, 2.4), second(41.01, 39.6, 2.41);
    for (const glm::dvec3& stray : {alone, first, second}) points.push_back({stray});
    test::writePly(folder / "a.ply", points, false);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    size_t ground = 0, wall = 0;
    for (const auto& [at, radius] : discsOf(*store)) {
        const auto near = [&](const glm::dvec3& p) { return glm::length(at - p) < 1e-3; };
        if (near(alone) || near(first) || near(second)) {
            EXPECT_LT(radius, 0.1) << "0.027 is a disc of the wall";
        } else if (std::abs(at.y - 40.5) < 1e-3 && at.z > 1.6 && at.z < 3.4 && at.x > 40.1 && at.x < 43.9) {
            ASSERT_GT(radius, 0.012) << "half the diagonal of its grid: 0.014";
            ++wall;
        } else if (std::abs(at.z) < 1e-3 && (at.x < 35 || at.x > 50)) {
            ASSERT_GT(radius, 0.5) << "half the diagonal of its grid: 0.7, less where neighbours are near";
            ++ground;
        }
    }
    EXPECT_GT(wall, 15000u);
    EXPECT_GT(ground, 4000u);
}

TEST(Discs, AStrayPointBeforeTheCameraHidesLittle) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    Rng rng(5);
    std::vector<test::TestPoint> points;  // ground 1 m apart, and one point 5 m above it, 2 m before the eye
    for (int i = 0; i < 6400; ++i)
        points.push_back({{i % 80 + 0.3 * rng.uniform(-1, 1), i / 80 + 0.3 * rng.uniform(-1, 1), 0}});
    points.push_back({{40, 40, 5}});
    test::writePly(folder / "a.ply", points, false);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    lod::View view;
    view.eye = {38, 40, 5};
    view.right = {0, -1, 0};
    view.down = {0, 0, -1};
    view.forward = {1, 0, 0};
    view.width = 1000;
    view.height = 800;
    view.focalPixels = 800;
    for (const auto& backend : {cpu::makeCpuBackend(*executor), reference::makeReferenceBackend(*executor)}) {
        const render::Image image = test::renderView(store, *backend, *executor, view, {});
        size_t sky = 0, ground = 0;
        for (uint32_t y = 0; y < image.height; ++y)  // the horizon is at row 500
            // The stray stands between these two columns, seen edge-on: one pixel, on either side.
            (y < 480 ? sky : ground) += image.rgba[size_t{y} * image.width + image.width / 2] >> 24 != 0 ||
                                        image.rgba[size_t{y} * image.width + image.width / 2 - 1] >> 24 != 0;
        EXPECT_LE(sky, 16u) << backend->name();  // a disc like those of the ground would hide all of it
        EXPECT_GE(sky, 1u) << backend->name();
        EXPECT_GE(ground, 250u) << backend->name();
    }
}

}  // namespace
}  // namespace stipple
