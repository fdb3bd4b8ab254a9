// The mesh hierarchy attacked: cuts without cracks, errors that bound, the same bytes for any number of threads.
#include <gtest/gtest.h>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/frame_passes.h"
#include "engine/scene/camera.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

/// A camera with random axes.
lod::View randomView(Rng& rng, const glm::dvec3& eye, uint32_t width, uint32_t height) {
    scene::Camera camera;
    const auto direction = [&] {
        for (;;) {
            const glm::dvec3 d(rng.uniform() * 2 - 1, rng.uniform() * 2 - 1, rng.uniform() * 2 - 1);
            if (glm::length(d) > 0.1 && glm::length(d) < 1) return glm::normalize(d);
        }
    };
    camera.eye = eye;
    camera.target = eye + direction();
    camera.up = direction();
    camera.fovDegrees = 20 + 90 * rng.uniform();
    return scene::makeView(camera, width, height, 1e-6);
}

std::shared_ptr<const lod::Store> rockFromInside(const std::string& path, Executor& executor, uint64_t seed,
                                                 uint64_t triangles) {
    test::MeshRecipe recipe;
    recipe.grow.kind = "rock";
    recipe.grow.triangles = triangles;
    recipe.grow.seed = seed;
    recipe.isTextured = false;
    recipe.isTwoSided = true;
    return test::growMeshStore(recipe, path, executor);
}

/// What is drawn of a store at `view`, with only the chunks that `residency` has.
lod::Cut cutOf(const lod::Store& store, const lod::View& view, double tau, const std::vector<uint8_t>& drawable) {
    const lod::Hierarchy* h = &store.hierarchy;
    const lod::Instance instance;
    const std::vector<std::vector<uint8_t>> residency{drawable};
    lod::CutScratch scratch;
    lod::Cut cut;
    lod::Budgets budgets;
    budgets.errorPixels = tau;
    selectCut({{&h, 1}, {&instance, 1}, {}}, {residency}, view, budgets, scratch, cut);
    return cut;
}

uint64_t emptyPixels(const lod::Store& store, const lod::Cut& cut, const lod::View& view, render::Backend& backend) {
    const lod::Hierarchy* h = &store.hierarchy;
    const lod::Instance instance;
    render::DrawList draws;
    draws.firstMaterial = {0};
    draws.materials = store.description.materials;
    makeDrawList(cut, {&h, 1}, {&instance, 1}, view, {}, draws);
    render::RenderRequest request;
    request.draws = &draws;
    request.mode = render::Mode::points;
    request.passes = render::passesOf(request.mode, render::contentOf(draws), draws.effects);
    render::Image image;
    EXPECT_TRUE(backend.render(request, image));
    return static_cast<uint64_t>(
        std::count_if(image.rgba.begin(), image.rgba.end(), [](uint32_t c) { return c >> 24 == 0; }));
}

TEST(MeshCut, ShowsNoCrackAtAnyCutOfAnyMeshFromAnywhereInside) {
    // From inside a closed surface every pixel must be covered, whatever is drawn at which level and whatever has not
    // arrived yet: a crack of one pixel anywhere is an empty pixel.
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto backend = cpu::makeCpuBackend(*executor);
    Rng rng(11);
    uint64_t frames = 0, levels = 0, controlHoles = 0;
    for (uint64_t seed = 1; seed <= 5; ++seed) {
        // The last one is built cell by cell: what holds between groups must hold between cells.
        const auto store = rockFromInside(folder / "rock.stipple", *executor, seed, seed < 5 ? 30'000 * seed : 600'000);
        const lod::Hierarchy& h = store->hierarchy;
        for (uint32_t n = 0; n < h.nodes.size(); ++n) {
            const auto chunk = lod::readChunk(*store, n);
            ASSERT_TRUE(chunk);
            ASSERT_TRUE(backend->upload({0, n}, *chunk));
        }
        for (int k = 0; k < 150; ++k) {
            const glm::dvec3 eye(rng.uniform() * 0.4 - 0.2, rng.uniform() * 0.4 - 0.2, rng.uniform() * 0.4 - 0.2);
            const lod::View view = randomView(rng, eye, 320, 200);
            const double tau = std::exp2(rng.uniform() * 9 - 3);
            std::vector<uint8_t> drawable(h.chunks(), 1);
            const double there = k % 3 == 0 ? 1 : rng.uniform();
            for (uint32_t n = 0; n < h.nodes.size(); ++n)
                drawable[n] = h.groups[n].parents == 0 || rng.uniform() < there ? 1 : 0;
            lod::Cut cut = cutOf(*store, view, tau, drawable);
            ASSERT_EQ(emptyPixels(*store, cut, view, *backend), 0u)
                << "seed " << seed << ", frame " << k << ", tau " << tau;
            ++frames;
            levels += cut.meshDraw.size();
            // Negative control: with one run missing there is a hole (if it is in view).
            if (cut.meshDraw.size() > 1) {
                cut.meshDraw.erase(
                    cut.meshDraw.begin() +
                    static_cast<ptrdiff_t>(rng.uniform() * 0.99 * static_cast<double>(cut.meshDraw.size())));
                controlHoles += emptyPixels(*store, cut, view, *backend) > 0;
            }
        }
        for (uint32_t n = 0; n < h.nodes.size(); ++n) backend->evict({0, n});
    }
    EXPECT_GT(levels, 5 * frames);
    EXPECT_GT(controlHoles, frames / 10);
}

TEST(MeshCut, DrawsEveryTriangleOfTheInputOnceWhereNothingIsTolerated) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    const auto store = rockFromInside(folder / "rock.stipple", *executor, 5, 40'000);
    Rng rng(3);
    const lod::Cut cut =
        cutOf(*store, test::fitView(*store, 640, 480), 1e-6, std::vector<uint8_t>(store->hierarchy.chunks(), 1));
    EXPECT_EQ(cut.counters.trianglesDrawn, store->description.points);
    uint64_t drawn = 0;
    for (const lod::CutMeshDraw& d : cut.meshDraw) {
        drawn += d.triangles;
        EXPECT_EQ(d.errorPixels, 0);
    }
    EXPECT_EQ(drawn, store->description.points);
    // A budget is kept, and said.
    const lod::Hierarchy* h = &store->hierarchy;
    const lod::Instance instance;
    const std::vector<std::vector<uint8_t>> residency{std::vector<uint8_t>(h->chunks(), 1)};
    lod::CutScratch scratch;
    lod::Cut budgeted;
    lod::Budgets budgets;
    budgets.errorPixels = 0.01;
    budgets.records = 5'000;
    selectCut({{&h, 1}, {&instance, 1}, {}}, {residency}, test::fitView(*store, 640, 480), budgets, scratch, budgeted);
    EXPECT_LE(budgeted.counters.trianglesDrawn, 5'000u);
    EXPECT_GT(budgeted.counters.trianglesDrawn, 2'000u);
    EXPECT_GT(budgeted.tauEffective, 0.01);
}

TEST(MeshErrors, BoundTheDistanceToTheInputBothWays) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    for (const char* kind : {"rock", "building", "terrain"})
        for (const bool isTextured : {false, true}) {
            test::MeshRecipe recipe;
            recipe.grow.kind = kind;
            // (Textured ones are built from several cells.)
            recipe.grow.triangles = isTextured ? 300'000 : 40'000;
            recipe.grow.textureSize = 64;
            recipe.isTextured = isTextured;
            const auto store = test::growMeshStore(recipe, folder / "a.stipple", *executor);
            const lod::Hierarchy& h = store->hierarchy;
            const auto leaves = test::leafTriangles(*store);
            ASSERT_EQ(leaves.size(), store->description.points);
            std::vector<uint32_t> codes;
            for (const lod::Node& n : h.nodes)
                if (n.errorCode < lod::ErrorScale::kNoParent) codes.push_back(n.errorCode);
            std::sort(codes.begin(), codes.end());
            size_t before = leaves.size() + 1;
            for (const double share : {0.2, 0.6, 0.9, 1.0}) {
                const uint32_t code = codes[static_cast<size_t>(share * static_cast<double>(codes.size() - 1))];
                const auto drawn = test::drawnTriangles(*store, test::evenCut(h, code));
                ASSERT_FALSE(drawn.empty());
                EXPECT_LT(drawn.size(), before) << kind;
                before = drawn.size();
                const double bound = h.errors.decode(code) * h.unit;
                EXPECT_LE(test::largestDistance(leaves, drawn, 4000, 7), bound) << kind << ", " << share;
                EXPECT_LE(test::largestDistance(drawn, leaves, 4000, 8), bound) << kind << ", " << share;
            }
            // And they are not idle: the coarsest cut is far closer than the size of the whole.
            const double size = glm::length(store->description.boundsMax - store->description.boundsMin);
            EXPECT_LT(h.errors.decode(codes[codes.size() / 2]) * h.unit, 0.05 * size) << kind;
        }
}

TEST(MeshBuild, GivesTheSameBytesForAnyNumberOfThreads) {
    const test::TempFolder folder;
    test::MeshRecipe recipe;
    recipe.grow.triangles = 400'000;
    recipe.grow.textureSize = 300;
    std::vector<std::string> files;
    for (const int threads : {1, 2, 4}) {
        const auto executor = makeTbbExecutor(threads);
        files.push_back(folder / std::to_string(threads));
        test::growMeshStore(recipe, files.back(), *executor);
    }
    EXPECT_EQ(test::slurp(files[0]), test::slurp(files[1]));
    EXPECT_EQ(test::slurp(files[0]), test::slurp(files[2]));
}

}  // namespace
}  // namespace stipple
