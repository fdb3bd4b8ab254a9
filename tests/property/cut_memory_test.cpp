// A cut allocates nothing once its scratch is warm, with instance groups and budgets too, and what it asks on the way
// about costs leaves no trace in what it reports. Nor does the thread of frames while chunks come and go.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/draw_list.h"
#include "engine/scene/camera.h"
#include "lod/cut/frame.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace {
std::atomic<uint64_t> allocations{0};
thread_local uint64_t ownAllocations = 0;  // of this thread
}  // namespace

void* operator new(size_t bytes) {
    ++allocations;
    ++ownAllocations;
    if (void* p = std::malloc(bytes)) return p;
    throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, size_t) noexcept { std::free(p); }

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

/// Round a place, near and far.
std::vector<lod::View> viewsOf(const glm::dvec3& centre, double size) {
    std::vector<lod::View> views;
    for (int k = 0; k < 40; ++k) {
        scene::Camera camera;
        const double a = 0.5 * k, distance = size * std::exp2(0.2 * (k % 20) - 1);
        camera.eye = centre + distance * glm::dvec3(std::cos(a), 0.4, std::sin(a));
        camera.target = centre;
        camera.up = {0, 1, 0};
        views.push_back(scene::makeView(camera, 1280, 720, 1e-3));
    }
    return views;
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
                    const uint64_t before = allocations;
                    lod::selectCut(scene, {*drawable}, view, {1, records}, scratch, cut);
                    *count += allocations - before;
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
    const Laps laps = fly({hierarchies, instances, {}}, viewsOf(h.origin + h.unit * h.nodes[0].centre, 4));
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
    const Laps laps = fly(state->scene(), viewsOf({44, 8, 44}, 60));
    EXPECT_GT(laps.first, 0u);
    EXPECT_EQ(laps.second, 0u);
    EXPECT_GT(laps.bound, 40u);
    EXPECT_GT(laps.partly, 40u);
    EXPECT_GT(laps.mixed, 40u);
}

/// What the thread of frames allocates up to the list of what is drawn, of a camera that flies round a ball of points
/// `laps` times; memory holds a part of what it sees. Tasks that read and decode are other threads', or run between
/// frames.
struct Flight {
    std::vector<uint64_t> allocated, uploads, evictions;  ///< of each lap
};
Flight flyStreamed(Executor& executor, const std::shared_ptr<const lod::Store>& store, size_t laps) {
    const auto backend = cpu::makeCpuBackend(executor);
    streaming::StreamSettings settings;
    settings.residentBytes = 1'100'000;
    settings.uploadBytesPerFrame = 100'000;
    settings.requestsInFlight = 16;
    const auto state = render::makeFrameState({store}, *backend, executor, settings);
    const lod::Hierarchy& h = store->hierarchy;
    const std::vector<lod::View> views = viewsOf(h.origin + h.unit * h.nodes[0].centre, 1.5);
    Flight flight;
    streaming::Streamer& streamer = *state->streamer;
    for (size_t lap = 0; lap < laps; ++lap) {
        const streaming::StreamCounters before = streamer.counters();
        uint64_t allocated = 0;
        for (const lod::View& view : views)
            for (int stay = 0; stay < 3; ++stay) {
                const uint64_t start = ownAllocations;
                streamer.collect();
                streamer.upload();
                lod::selectCut(state->scene(), streamer.residency(), view, {1, kNoLimit}, state->scratch, state->cut);
                streamer.request(state->cut);
                render::makeDrawList(state->cut, state->hierarchies, state->instances, view, {}, state->draws);
                allocated += ownAllocations - start;
                streamer.wait();
            }
        flight.allocated.push_back(allocated);
        flight.uploads.push_back(streamer.counters().uploads - before.uploads);
        flight.evictions.push_back(streamer.counters().evictions - before.evictions);
    }
    return flight;
}

TEST(CutMemory, FramesThatStreamAllocateNothingOnceWarm) {
    const test::TempFolder folder;
    const auto several = makeTbbExecutor(2), one = makeTbbExecutor(1), serial = makeSerialExecutor();
    test::writePly(folder / "a.ply", test::bumpySphere(60'000, 1));
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *several);
    for (Executor* const executor : {serial.get(), one.get(), several.get()}) {
        const Flight flight = flyStreamed(*executor, store, 5);
        EXPECT_GT(flight.allocated.front(), 0u) << "the count must see what cold frames take";
        for (size_t lap = 3; lap < 5; ++lap) {
            EXPECT_EQ(flight.allocated[lap], 0u) << flight.uploads[lap] << " chunks came";
            EXPECT_GT(flight.uploads[lap], 40u);
            EXPECT_GT(flight.evictions[lap], 40u);
        }
    }
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
    for (const lod::View& view : viewsOf(h.origin + h.unit * h.nodes[0].centre, 2)) {
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
        for (const lod::View& view : viewsOf(h.origin + h.unit * h.nodes[0].centre, h.unit * h.nodes[0].radius)) {
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
