// A cut allocates nothing once its scratch is warm, with instance groups and budgets too, and what it asks on the way
// about costs leaves no trace in what it reports.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/cpu/cpu_backend.h"
#include "lod/cut/frame.h"
#include "tests/support/allocations.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

using OpenStore = std::shared_ptr<const lod::Store>;
/// A ball of points, and a terrain of triangles.
std::pair<OpenStore, OpenStore> ballAndTerrain(const test::TempFolder& folder, size_t points, uint64_t triangles,
                                               Executor& executor) {
    test::writePly(folder / "a.ply", test::bumpySphere(points, 1));
    test::MeshRecipe recipe;
    recipe.grow.kind = "terrain";
    recipe.grow.triangles = triangles;
    return {test::buildAndOpen(folder / "a.ply", folder / "a.stipple", executor),
            test::growMeshStore(recipe, folder / "b.stipple", executor)};
}

struct Laps {
    uint64_t first = 0, second = 0;           ///< allocations
    size_t bound = 0, partly = 0, mixed = 0;  ///< cuts with a budget that binds, that miss chunks, with some members
};
/// The same cuts twice with one scratch: every budget from every view, all resident and not.
Laps fly(const lod::CutScene& scene, const std::vector<lod::View>& views) {
    std::vector<std::vector<uint8_t>> all, some;
    Rng rng(3);
    for (const lod::Instance& i : scene.instances) {
        if (all.size() <= i.source) all.resize(i.source + 1);
        all[i.source].assign(scene.hierarchies[i.hierarchy]->chunks(), 1);
    }
    some = all;
    for (auto& of : some)
        for (size_t n = 1; n < of.size(); ++n) of[n] = rng.below(3) > 0 ? 1 : 0;
    lod::CutScratch scratch;
    lod::Cut cut;
    Laps laps;
    for (uint64_t* const count : {&laps.first, &laps.second})
        for (const lod::View& view : views)
            for (const auto* drawable : {&all, &some})
                for (const uint64_t records : {kNoLimit, uint64_t{50'000}, uint64_t{5'000}}) {
                    const uint64_t before = test::allocations();
                    lod::selectCut(scene, {*drawable}, view, {1, records}, scratch, cut);
                    *count += test::allocations() - before;
                    laps.bound += cut.tauTarget > 1 ? 1 : 0;
                    laps.partly += cut.wanted.empty() ? 0 : 1;
                    laps.mixed += cut.counters.groupMembers > 0 ? 1 : 0;
                }
    return laps;
}

TEST(CutMemory, NothingIsAllocatedOnceWarm) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    test::writePly(folder / "a.ply", test::bumpySphere(30'000, 1));
    const auto points = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    test::MeshRecipe recipe;
    recipe.grow.kind = "terrain";
    recipe.grow.triangles = 30'000;
    recipe.grow.textureSize = 512;
    const auto mesh = test::growMeshStore(recipe, folder / "b.stipple", *executor);
    const std::vector<const lod::Hierarchy*> hierarchies{&points->hierarchy, &mesh->hierarchy};
    std::vector<lod::Instance> instances(2);
    instances[1].hierarchy = instances[1].source = 1;
    const lod::Hierarchy& h = points->hierarchy;
    const Laps laps = fly({hierarchies, instances, {}}, test::viewsRound(h.origin + h.unit * h.nodes[0].centre, 4));
    EXPECT_GT(laps.first, 0u) << "the count must see what a cold scratch takes";
    EXPECT_EQ(laps.second, 0u);
    EXPECT_GT(laps.bound, 40u);
    EXPECT_GT(laps.partly, 40u);
}

TEST(CutMemory, NothingIsAllocatedOnceWarmWithInstanceGroups) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const test::Forest forest = test::plantForest(folder.path(), 12, *executor);
    const auto backend = cpu::makeCpuBackend(*executor);
    const auto state = render::makeFrameState(forest.placed, *backend, *executor, {}, forest.groups);
    const Laps laps = fly(state->scene(), test::viewsRound({44, 8, 44}, 60));
    EXPECT_GT(laps.first, 0u);
    EXPECT_EQ(laps.second, 0u);
    EXPECT_GT(laps.bound, 40u);
    EXPECT_GT(laps.partly, 40u);
    EXPECT_GT(laps.mixed, 40u);
}

// What a cut reports to have visited is what it went through to draw, not what it compared that with.
TEST(CutMemory, QuestionsAboutCostsAreNotCounted) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto [points, mesh] = ballAndTerrain(folder, 2'000, 30'000, *executor);
    const std::vector<const lod::Hierarchy*> hierarchies{&mesh->hierarchy, &points->hierarchy};
    std::vector<lod::Instance> pair(2);
    pair[0].proxy = 1;
    pair[1].hierarchy = pair[1].source = 1;
    pair[1].isDriven = true;
    std::vector<lod::Instance> alone(1);
    alone[0] = pair[1];
    alone[0].isDriven = false;
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(mesh->hierarchy.chunks(), 1),
                                                     std::vector<uint8_t>(points->hierarchy.chunks(), 1)};
    const lod::Hierarchy& h = points->hierarchy;
    size_t drawn = 0;
    for (const lod::View& view : test::viewsRound(h.origin + h.unit * h.nodes[0].centre, 2)) {
        lod::CutScratch a, b;
        lod::Cut with, without;
        lod::selectCut({hierarchies, pair, {}}, {drawable}, view, {0.25, kNoLimit}, a, with);
        lod::selectCut({hierarchies, alone, {}}, {drawable}, view, {0.25, kNoLimit}, b, without);
        if (with.counters.proxies == 0) continue;
        ++drawn;
        ASSERT_EQ(with.counters.nodesVisited, without.counters.nodesVisited);
        ASSERT_EQ(with.counters.nodesCulled, without.counters.nodesCulled);
    }
    EXPECT_GT(drawn, 3u);
}

// Budgets are met by counting before anything is emitted: what is counted is what is drawn then, and to count, at
// whatever step, changes nothing of it.
TEST(CutMemory, WhatIsCountedIsWhatIsDrawn) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto [points, mesh] = ballAndTerrain(folder, 20'000, 20'000, *executor);
    const test::Forest forest = test::plantForest(folder.path(), 4, *executor);
    Rng rng(9);
    size_t partly = 0;
    for (const lod::Store* store : {points.get(), mesh.get(), forest.curves.get(), forest.afar.get()}) {
        const lod::Hierarchy& h = store->hierarchy;
        const std::vector<const lod::Hierarchy*> hierarchies{&h};
        const std::vector<lod::Instance> instances(1);
        const lod::CutScene scene{hierarchies, instances, {}};
        for (const lod::View& view :
             test::viewsRound(h.origin + h.unit * h.nodes[0].centre, h.unit * h.nodes[0].radius)) {
            std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(h.chunks(), 1)};
            const bool isWhole = rng.below(3) == 0;
            for (uint8_t& d : drawable[0]) d = isWhole || rng.below(3) > 0 ? 1 : 0;
            const lod::Residency residency{drawable};
            lod::CutScratch scratch;
            lod::Cut cut;
            lod::selectCut(scene, residency, view, {1, kNoLimit}, scratch, cut);  // tau = 1: step 0
            const uint64_t drawn = cut.counters.recordsDrawn + cut.counters.trianglesDrawn;
            const lod::CutFrame frame{scene, residency, view, scratch};
            const lod::ShapeTraits& kind = lod::shapeOf(h);
            const auto cost = [&](int step, lod::Counted counted) {
                return kind.cutCost(frame, 0, step, kNoLimit, counted, nullptr);
            };
            for (const int step : {-64, 100, 0}) {
                (void)cost(step, lod::Counted::all);
                (void)cost(step, lod::Counted::drawable);
            }
            ASSERT_EQ(cost(0, lod::Counted::drawable).records, drawn) << kind.name;
            if (cost(0, lod::Counted::all).isWhole) ASSERT_EQ(cost(0, lod::Counted::all).records, drawn) << kind.name;
            partly += cost(0, lod::Counted::all).isWhole ? 0 : 1;
            lod::Cut again;
            lod::ActiveMembers members{scratch.members};
            kind.cutEmit(frame, 0, 0, members, again);
            ASSERT_EQ(again.draw.size() + again.meshDraw.size(), cut.draw.size() + cut.meshDraw.size());
            ASSERT_EQ(again.counters.recordsDrawn + again.counters.trianglesDrawn, drawn);
        }
    }
    EXPECT_GT(partly, 40u);
}

}  // namespace
}  // namespace stipple
