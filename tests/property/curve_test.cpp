// The hierarchy of ribbons and tubes attacked: errors that bound, everything drawn once, the same bytes for any number
// of threads.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/reference/decode.h"
#include "tests/support/curves.h"

namespace stipple {
namespace {

using reference::Segment;

/// What a cut with the same allowed error everywhere draws.
std::vector<Segment> drawnAt(const lod::Store& store, uint32_t code) {
    std::vector<Segment> out;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        const lod::Node& node = h.nodes[i];
        const auto chunk = lod::readChunk(store, i);
        EXPECT_TRUE(chunk);
        const uint32_t count = i == 0 ? node.records : h.countGreater(node.parentCounts, node.records, code);
        for (uint32_t k = 0; k < count; ++k)
            if (const Segment s = reference::decodeSegment(h, node, chunk->segments[k]); s.errorCode <= code)
                out.push_back(s);
    }
    return out;
}

/// How far the ball at p is from the nearest ball of a segment: |p - q| + |r - rho|, at most.
double distance(const glm::dvec3& p, double r, const Segment& s) {
    const glm::dvec3 d = s.b - s.a;
    const double u = std::clamp(glm::dot(p - s.a, d) / std::max(glm::dot(d, d), 1e-300), 0.0, 1.0);
    return glm::length(p - s.a - u * d) + std::abs(r - (s.radiusA + u * (s.radiusB - s.radiusA)));
}
double nearest(const glm::dvec3& p, double r, const std::vector<Segment>& among) {
    double best = 1e300;
    for (const Segment& s : among) best = std::min(best, distance(p, r, s));
    return best;
}

TEST(CurveHierarchy, StatedErrorsBoundTheDistanceBothWays) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::CurlRecipe recipe;
    recipe.count = 60;
    recipe.vertices = 80;
    recipe.radius = 0.004f;
    const auto store = test::buildCurves(test::curls(recipe), folder / "a.stipple", *executor, 128);
    const lod::Hierarchy& h = store->hierarchy;
    ASSERT_GT(h.nodes.size(), 20u);
    const std::vector<Segment> leaves = drawnAt(*store, 0);
    EXPECT_GE(leaves.size(), store->description.points);
    Rng rng(4);
    size_t coarser = leaves.size();
    for (uint32_t code = 16; code < 200; code += 8) {
        const std::vector<Segment> drawn = drawnAt(*store, code);
        ASSERT_FALSE(drawn.empty());
        EXPECT_LE(drawn.size(), coarser + coarser / 10);
        coarser = std::min(coarser, drawn.size());
        // Positions are rounded in the leaves as well; radii to a 256th.
        const double stated =
            h.unit * h.errors.decode(code) + store->description.roundingUnits + static_cast<double>(recipe.radius) / 64;
        for (size_t k = 0; k < 300; ++k) {
            const Segment& s =
                leaves[static_cast<size_t>(rng.uniform() * 0.999999 * static_cast<double>(leaves.size()))];
            const double u = rng.uniform();
            ASSERT_LE(nearest(glm::mix(s.a, s.b, u), glm::mix(s.radiusA, s.radiusB, u), drawn), stated) << code;
            const Segment& d = drawn[static_cast<size_t>(rng.uniform() * 0.999999 * static_cast<double>(drawn.size()))];
            ASSERT_LE(nearest(glm::mix(d.a, d.b, u), glm::mix(d.radiusA, d.radiusB, u), leaves), stated) << code;
        }
    }
    EXPECT_LT(coarser, leaves.size() / 4);
}

TEST(CurveHierarchy, VerificationMeasuresTheErrorsAgain) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::CurlRecipe recipe;
    recipe.count = 60;
    recipe.vertices = 80;
    const auto store = test::buildCurves(test::curls(recipe), folder / "a.stipple", *executor, 128);
    const auto good = lod::verifyStore(*store, *executor);
    ASSERT_TRUE(good) << good.error().line();
    EXPECT_GT(good->errorsMeasured, 100u);
    // Errors that are said to be a 30th of what they are do not pass.
    lod::Store wrong = *store;
    wrong.hierarchy.errors.smallest /= 30;
    const auto found = lod::verifyStore(wrong, *executor);
    ASSERT_FALSE(found);
    EXPECT_NE(found.error().line().find("off the leaves, its error says"), std::string::npos) << found.error().line();
}

TEST(CurveHierarchy, EverythingIsDrawnOnceAtAnyError) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::CurlRecipe recipe;
    recipe.vertices = 40;
    const auto store = test::buildCurves(test::curls(recipe), folder / "a.stipple", *executor, 128);
    const auto lengthOf = [](const std::vector<Segment>& of) {
        double sum = 0;
        for (const Segment& s : of) sum += glm::length(s.b - s.a);
        return sum;
    };
    const double all = lengthOf(drawnAt(*store, 0));
    for (uint32_t code = 1; code <= 120; code += 7) {
        const double length = lengthOf(drawnAt(*store, code));
        EXPECT_LE(length, all * 1.001) << code;  // nothing twice: chords are shorter than what they stand for
        EXPECT_GE(length, all * 0.9) << code;    // and nothing left out
    }
}

TEST(CurveHierarchy, PruningKeepsTheArea) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::CurlRecipe recipe;
    recipe.count = 20'000;
    recipe.vertices = 4;
    recipe.radius = 0.0003f;
    const auto store = test::buildCurves(test::curls(recipe), folder / "a.stipple", *executor, 256);
    const auto areaOf = [](const std::vector<Segment>& of) {
        double sum = 0;
        for (const Segment& s : of) sum += glm::length(s.b - s.a) * (s.radiusA + s.radiusB);
        return sum;
    };
    const std::vector<Segment> leaves = drawnAt(*store, 0), root = drawnAt(*store, 253);
    EXPECT_LT(root.size(), leaves.size() / 20);
    const double all = areaOf(leaves);
    for (uint32_t code = 40; code < 254; code += 30) EXPECT_NEAR(areaOf(drawnAt(*store, code)) / all, 1, 0.1) << code;
}

TEST(CurveHierarchy, TheSameBytesForAnyNumberOfThreads) {
    const test::TempFolder folder;
    const lod::CurveSet curves = test::curls({});
    std::string first;
    for (const int threads : {1, 2, 5}) {
        const auto executor = makeTbbExecutor(threads);
        test::buildCurves(curves, folder / "a.stipple", *executor, 64);
        const std::string bytes = test::slurp(folder / "a.stipple");
        if (first.empty()) first = bytes;
        EXPECT_TRUE(bytes == first) << threads;
    }
}

TEST(CurveHierarchy, LongSegmentsBesideShortOnesAreDivided) {
    // A wire of one segment across a thicket: its parts must fit the cells of the thicket.
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    lod::CurveSet curves = test::curls({});
    curves.addVertex({-50, 0, 0}, 0.01f, {}, 0xffffff);
    curves.addVertex({50, 0.5, 0}, 0.01f, {}, 0xffffff);
    curves.endCurve(false);
    const auto store = test::buildCurves(curves, folder / "a.stipple", *executor, 128);
    ASSERT_TRUE(store);
    const std::vector<Segment> leaves = drawnAt(*store, 0);
    for (const double x : {-49.9, -20.0, 0.0, 33.3, 49.9})
        EXPECT_LE(nearest({x, 0.25 + 0.005 * x, 0}, 0.01, leaves), 1e-3);
}

}  // namespace
}  // namespace stipple
