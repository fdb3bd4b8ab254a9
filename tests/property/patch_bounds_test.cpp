// What leaves of patches say of their distance from the source: each its own, so that a picture's error is that of what
// it draws; and that they say enough.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>

#include "engine/scene/camera.h"
#include "lod/builder/patch_store/against.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "lod/cut/cut.h"
#include "tests/support/crafted_store.h"
#include "tests/support/patch_cuts.h"
#include "tests/support/triangle_field.h"

namespace stipple::lod {
namespace {

using test::Triangle;

Store buildMesh(const TriangleMesh& mesh, const std::string& path, const PatchBuildSettings& settings) {
    const auto executor = makeTbbExecutor(2);
    Progress silent(false);
    const auto report = buildPatchStore(sourceOf(mesh), path, settings, *executor, silent);
    EXPECT_TRUE(report) << (report ? "" : report.error().line());
    auto store = openStore(path);
    EXPECT_TRUE(store);
    return store ? std::move(*store) : Store();
}
/// Leaves of few triangles, so that there are several levels.
PatchBuildSettings finely() {
    PatchBuildSettings settings;
    settings.leafTriangles = 1500;
    settings.description.materials.resize(1);
    return settings;
}

constexpr double kFarAway = 12;

/// A smooth, small torus about the origin, and far from it a large sheet of spikes, each a triangle wide.
TriangleMesh torusAndSpikes() {
    TriangleMesh mesh = test::torusMesh(100, 40);
    mesh.normal.clear();
    for (glm::dvec3& p : mesh.position) p *= 0.1;
    Rng rng(5);
    const TriangleMesh rough = test::sheet(
        60, 60, [&](double u, double v) { return glm::dvec3(kFarAway + u, v - 0.5, 0.25 * rng.uniform()); });
    const auto first = static_cast<uint32_t>(mesh.position.size());
    mesh.position.insert(mesh.position.end(), rough.position.begin(), rough.position.end());
    for (const uint32_t i : rough.indices) mesh.indices.push_back(first + i);
    return mesh;
}

/// The error, px, that a picture of full detail says, seen from so far above `centre`.
double saidFrom(const Hierarchy& h, const glm::dvec3& centre, double distance) {
    scene::Camera camera;
    camera.eye = centre + glm::dvec3(0, 0, distance);
    camera.target = centre;
    camera.up = {0, 1, 0};
    const std::vector<const Hierarchy*> hierarchies{&h};
    const std::vector<Instance> instances{{}};
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(h.chunks(), 1)};
    CutScratch scratch;
    Cut cut;
    selectCut({hierarchies, instances, {}}, {drawable}, scene::makeView(camera, 800, 600, 1e-3), {1e-3}, scratch, cut);
    EXPECT_EQ(cut.counters.leavesAround, 0u);
    EXPECT_GT(cut.counters.trianglesDrawn, 0u);
    return cut.tauEffective;
}

TEST(PatchBounds, APictureSaysTheDistanceOfTheLeavesThatItDraws) {
    const test::TempFolder folder;
    const TriangleMesh mesh = torusAndSpikes();
    Store store = buildMesh(mesh, folder / "a.stipple", finely());
    Hierarchy& h = store.hierarchy;
    EXPECT_FALSE(h.hasOneSourceCode);
    const std::vector<Triangle> all = test::trianglesOf(mesh);
    const test::TriangleField source(all);
    uint32_t smooth = 0, rough = 0;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        const Node& node = h.nodes[n];
        EXPECT_EQ(node.sourceCode != 0, node.isLeaf());
        if (!node.isLeaf()) continue;
        for (uint32_t up = node.parent, k = n; k != 0; k = up, up = h.nodes[k].parent)
            EXPECT_GE(h.errorCodeOf(up), node.sourceCode) << "node " << up << " above leaf " << n;
        const double stated = h.unit * h.errors.decode(node.sourceCode);
        for (const Triangle& t : test::trianglesOf(store, n))
            EXPECT_LE(source.distance((t[0] + t[1] + t[2]) / 3.0, 2 * stated), stated) << "leaf " << n;
        uint32_t& most = h.origin.x + h.unit * node.centre.x < 0.5 * kFarAway ? smooth : rough;
        most = std::max<uint32_t>(most, node.sourceCode);
    }
    EXPECT_LT(h.errors.decode(smooth), 0.2 * h.errors.decode(rough));
    // As many pixels as the leaves' distance is at the nearest place of the torus, and no fewer than at the farthest.
    const double focal = scene::makeView({}, 800, 600, 1e-3).focalPixels;
    const double pixels = focal * h.unit * h.errors.decode(smooth);
    const double said = saidFrom(h, {0, 0, 0}, 0.6);
    EXPECT_LE(said, pixels / 0.35);
    EXPECT_GE(said, pixels / 0.8);
    EXPECT_GE(saidFrom(h, {kFarAway + 1.5, 0, 0}, 6), focal * h.unit * h.errors.decode(rough) / 8);
    // The control: one number for all of the store.
    for (Node& n : h.nodes)
        if (n.isLeaf()) n.sourceCode = static_cast<uint8_t>(rough);
    EXPECT_GT(saidFrom(h, {0, 0, 0}, 0.6), 2 * pixels / 0.35);
}

TEST(PatchBounds, MeasuringAgainstTheSourceHoldsEachLeafToItsOwn) {
    const test::TempFolder folder;
    const TriangleMesh mesh = torusAndSpikes();
    Store store = buildMesh(mesh, folder / "a.stipple", finely());
    const auto executor = makeTbbExecutor(2);
    const auto right = measureAgainst(store, mesh, 20'000, *executor);
    ASSERT_TRUE(right);
    EXPECT_EQ(right->far, 0u);
    EXPECT_LE(right->most, 1 + 1e-9);
    EXPECT_GT(right->most, 0.1);
    // The control: a leaf of the torus that states a 64th is found, though all are nearer than the worst one states.
    for (Node& n : store.hierarchy.nodes)
        if (n.isLeaf() && store.hierarchy.origin.x + store.hierarchy.unit * n.centre.x < 0.5 * kFarAway)
            n.sourceCode -= std::min<uint8_t>(n.sourceCode, 48);
    const auto wrong = measureAgainst(store, mesh, 20'000, *executor);
    ASSERT_TRUE(wrong);
    EXPECT_GT(wrong->far, 0u);
    EXPECT_GT(wrong->most, 1);
    EXPECT_EQ(wrong->stated, right->stated);
}

/// Spikes of any slope, each a triangle: no patch is worth its samples.
TriangleMesh noise(uint32_t across) {
    Rng rng(7);
    return test::sheet(across, across,
                       [&](double u, double v) { return glm::dvec3(4 * u, 4 * v, 0.1 * rng.uniform()); });
}

TEST(PatchBounds, SamplesAreNoMoreThanAreWorthIt) {
    const test::TempFolder folder;
    for (const bool isRough : {true, false}) {
        SCOPED_TRACE(isRough);
        const TriangleMesh mesh = isRough ? noise(50) : test::wavyTorus(120, 60);
        const Store store = buildMesh(mesh, folder / "a.stipple", finely());
        double triangles = static_cast<double>(store.description.pointsIn);
        for (const auto& [reason, count] : store.description.added) triangles += static_cast<double>(count);
        EXPECT_LE(static_cast<double>(store.description.patches.samples), 5 * triangles);
        EXPECT_GE(static_cast<double>(store.description.patches.samples), isRough ? 0.0 : 0.5 * triangles);
        const auto executor = makeTbbExecutor(2);
        const auto right = measureAgainst(store, mesh, 5'000, *executor);
        ASSERT_TRUE(right);
        EXPECT_EQ(right->far, 0u);
    }
}

TEST(PatchBounds, AsManySamplesAsAreAskedForWithinAFifth) {
    const test::TempFolder folder;
    const TriangleMesh mesh = test::wavyTorus(200, 80);
    for (const uint64_t samples : {8'000, 40'000, 200'000}) {
        PatchBuildSettings settings = finely();
        settings.leafTriangles = 8'000;
        settings.samples = samples;
        const Store store = buildMesh(mesh, folder / "a.stipple", settings);
        const double part = static_cast<double>(store.description.patches.samples) / static_cast<double>(samples);
        EXPECT_GE(part, 0.8) << samples;
        EXPECT_LE(part, 1.2) << samples;
    }
}

/// Stores of build version 15 state one distance, in their description.
TEST(PatchBounds, AnOldStoreStatesTheWorstOfAllItsLeaves) {
    const auto golden = openStore(std::string(STIPPLE_SOURCE_DIR) + "/tests/golden/stores/patches_9.stipple");
    ASSERT_TRUE(golden) << golden.error().line();
    const Hierarchy& h = golden->hierarchy;
    EXPECT_TRUE(h.hasOneSourceCode);
    EXPECT_EQ(h.nodes.at(0).sourceCode, h.errors.encodeUp(golden->description.roundingUnits / h.unit));
    EXPECT_NEAR(h.unit * h.errors.decode(h.nodes[0].sourceCode), 0.0553, 0.005);
    const auto executor = makeTbbExecutor(2);
    const auto verified = verifyStore(*golden, *executor);
    EXPECT_TRUE(verified) << verified.error().line();
}

/// Of a later store each leaf states its own, or it is refused.
TEST(PatchBounds, ALeafThatStatesNoDistanceIsNoOldStore) {
    const test::TempFolder folder;
    const Store store = buildMesh(test::wavyTorus(120, 60), folder / "a.stipple", finely());
    ASSERT_GT(store.hierarchy.nodes.size(), 2u);
    test::CraftedStore crafted = test::CraftedStore::read(folder / "a.stipple");
    crafted.write(folder / "same.stipple");
    EXPECT_TRUE(openStore(folder / "same.stipple"));
    crafted.nodes.back().sourceCode = 0;
    crafted.write(folder / "one.stipple");
    const auto one = openStore(folder / "one.stipple");
    ASSERT_FALSE(one);
    EXPECT_NE(one.error().line().find("does not state its distance"), std::string::npos) << one.error().line();
    // Where none does, it is as old stores are.
    for (auto& n : crafted.nodes) n.sourceCode = 0;
    crafted.write(folder / "old.stipple");
    const auto old = openStore(folder / "old.stipple");
    ASSERT_TRUE(old) << old.error().line();
    EXPECT_TRUE(old->hierarchy.hasOneSourceCode);
}

/// One leaf: what is asked within it is asked often, and nothing is written.
TEST(PatchBounds, ABuildStopsWithinALeaf) {
    const test::TempFolder folder;
    const TriangleMesh mesh = torusAndSpikes();
    const auto executor = makeTbbExecutor(2);
    Progress silent(false);
    std::atomic<uint64_t> asked{0};
    const auto build = [&](uint64_t stopsAt, const std::string& path) {
        asked = 0;
        PatchBuildSettings settings;
        settings.limits.isStopped = [&asked, stopsAt] { return ++asked >= stopsAt; };
        return buildPatchStore(sourceOf(mesh), path, settings, *executor, silent);
    };
    ASSERT_TRUE(build(~uint64_t{0}, folder / "whole.stipple"));
    const uint64_t whole = asked;
    EXPECT_GT(whole, 200u);
    for (const uint64_t part : {whole / 8, whole / 3, whole / 2}) {
        const std::string path = folder / "part.stipple";
        const auto stopped = build(part, path);
        ASSERT_FALSE(stopped) << part << " of " << whole;
        EXPECT_EQ(stopped.error().kind, ErrorKind::interrupted);
        EXPECT_FALSE(std::filesystem::exists(path));
    }
}

}  // namespace
}  // namespace stipple::lod
