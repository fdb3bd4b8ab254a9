// Small builds, pictures and streams on several threads, for the thread sanitizer: what the slow tests do at length.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/cpu/cpu_backend.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

constexpr int kThreads = 4;

std::vector<std::string> storesBuiltBy(Executor& executor, const test::TempFolder& folder) {
    test::writePly(folder / "a.ply", test::bumpySphere(6000, 1));
    lod::BuildSettings settings;
    settings.leafRecords = 256;
    test::build({folder / "a.ply"}, folder / "points.stipple", executor, settings);
    test::MeshRecipe recipe;
    recipe.grow.triangles = 6000;
    recipe.grow.textureSize = 64;
    test::growMeshStore(recipe, folder / "mesh.stipple", executor);
    test::buildCurves(test::curls({.count = 80, .vertices = 30}), folder / "curves.stipple", executor, 64);
    return {folder / "points.stipple", folder / "mesh.stipple", folder / "curves.stipple"};
}

TEST(Threads, SeveralBuildWhatOneBuilds) {
    const test::TempFolder one, several;
    const auto serial = makeSerialExecutor(), parallel = makeTbbExecutor(kThreads);
    const std::vector<std::string> expected = storesBuiltBy(*serial, one), built = storesBuiltBy(*parallel, several);
    for (size_t k = 0; k < expected.size(); ++k)
        EXPECT_TRUE(test::slurp(expected[k]) == test::slurp(built[k])) << built[k];
}

/// Chunks arrive while the camera moves, and room is short: decoding, evicting and drawing at once.
TEST(Threads, SeveralStreamAndDrawWhatOneDraws) {
    const test::TempFolder folder;
    const auto serial = makeSerialExecutor(), parallel = makeTbbExecutor(kThreads);
    std::vector<render::PlacedStore> placed;
    for (const std::string& path : storesBuiltBy(*serial, folder)) {
        auto store = lod::openStore(path);
        ASSERT_TRUE(store) << store.error().line();
        placed.push_back({std::make_shared<const lod::Store>(std::move(*store)), {}, {}});
    }
    const auto picturesOf = [&](Executor& executor) {
        const auto backend = cpu::makeCpuBackend(executor);
        streaming::StreamSettings stream;
        stream.residentBytes = 256 << 10;
        auto state = render::makeFrameState(placed, *backend, executor, stream);
        render::FrameSettings settings;
        std::vector<render::Image> pictures;
        for (const double away : {12.0, 5.0, 3.0, 6.0}) {
            lod::View view = test::viewFromAbove(glm::dvec3(0, 0, away - 3));
            view.width = view.height = 120;
            view.focalPixels *= 120.0 / 400;
            for (int k = 0; k < 4; ++k)  // as an impatient window does
                EXPECT_TRUE(render::renderFrame(*state, view, settings));
            EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
            pictures.push_back(state->image);
        }
        return pictures;
    };
    const std::vector<render::Image> expected = picturesOf(*serial), drawn = picturesOf(*parallel);
    ASSERT_EQ(drawn.size(), expected.size());
    for (size_t k = 0; k < drawn.size(); ++k) {
        EXPECT_TRUE(drawn[k].rgba == expected[k].rgba) << k;
        EXPECT_NE(std::count_if(drawn[k].rgba.begin(), drawn[k].rgba.end(), [](uint32_t c) { return c >> 24 != 0; }),
                  0);
    }
}

}  // namespace
}  // namespace stipple
