// A backend keeps buffers from frame to frame and leaves alone what nothing was drawn into: whatever it drew before,
// a frame is the same bytes as a new backend's.
#include <gtest/gtest.h>

#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

TEST(Frames, ShowNothingOfThoseBefore) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writePly(folder / "a.ply", test::bumpySphere(20'000, 1));
    test::MeshRecipe textured;
    textured.grow.kind = "building";
    textured.grow.triangles = 5'000;
    textured.grow.textureSize = 128;
    std::vector<std::shared_ptr<const lod::Store>> stores{
        test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor),
        test::growMeshStore(textured, folder / "b.stipple", *executor),
        test::buildCurves(test::curls({}), folder / "c.stipple", *executor)};
    // Side by side along x, each a unit wide and 2 apart.
    std::vector<render::PlacedStore> placed;
    for (size_t k = 0; k < stores.size(); ++k) {
        const auto& d = stores[k]->description;
        lod::Instance place;
        place.scale = 1 / glm::length(d.boundsMax - d.boundsMin);
        place.translation =
            glm::dvec3(2.0 * static_cast<double>(k), 0, 0) - place.scale * 0.5 * (d.boundsMin + d.boundsMax);
        placed.push_back({stores[k], place, {}});
    }
    const auto kept = cpu::makeCpuBackend(*executor);
    const auto keptState = render::makeFrameState(placed, *kept, *executor, {});
    Rng rng(5);
    size_t compared = 0, empty = 0;
    for (int frame = 0; frame < 60; ++frame) {
        lod::View view;
        view.right = {1, 0, 0};
        view.down = {0, 0, -1};
        view.forward = {0, rng.uniform(0, 1) < 0.15 ? -1.0 : 1.0, 0};
        view.down = glm::cross(view.forward, view.right);
        view.eye = {rng.uniform(-1, 5), -std::exp(rng.uniform(-4, 1.5)) - 0.4, rng.uniform(-0.6, 0.6)};
        view.width = frame % 20 < 10 ? 301 : 260;  // a change of size now and then
        view.height = 203;
        view.focalPixels = 250;
        render::FrameSettings settings;
        settings.mode = render::reconstructions()[rng.below(render::reconstructions().size())].mode;
        settings.draw.lit = rng.uniform(0, 1) < 0.5;
        settings.wantDepthAndNormal = rng.uniform(0, 1) < 0.7;
        settings.budgets.errorPixels = 1;
        const auto fresh = cpu::makeCpuBackend(*executor);
        const auto freshState = render::makeFrameState(placed, *fresh, *executor, {});
        for (render::FrameState* state : {keptState.get(), freshState.get()})
            ASSERT_TRUE(render::renderUntilComplete(*state, view, settings));
        const render::Image &a = keptState->image, &b = freshState->image;
        SCOPED_TRACE(testing::Message() << "frame " << frame);
        EXPECT_TRUE(a.rgba == b.rgba);
        EXPECT_TRUE(a.depth == b.depth && a.normal == b.normal && a.linear == b.linear);
        const bool any = std::any_of(b.rgba.begin(), b.rgba.end(), [](uint32_t p) { return p >> 24 != 0; });
        compared += any;
        empty += !any;
    }
    EXPECT_GT(compared, 30u);
    EXPECT_GT(empty, 3u);
}

}  // namespace
}  // namespace stipple
