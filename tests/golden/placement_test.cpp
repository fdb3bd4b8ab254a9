// Stores placed in a scene: moved, turned, scaled and repeated, the picture is that of the moved camera.
#include <gtest/gtest.h>

#include <fstream>
#include <glm/gtc/matrix_transform.hpp>
#include <nlohmann/json.hpp>

#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "engine/scene/scene.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

class Placement : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(20'000, 3));
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, 1024);
    }
    render::Image draw(const lod::Instance& place, const scene::Camera& camera, double nearPlane) {
        const auto backend = cpu::makeCpuBackend(*executor_);
        auto state = render::makeFrameState({render::PlacedStore{store_, place, {}}}, *backend, *executor_, {});
        render::FrameSettings settings;
        settings.draw.lit = true;
        settings.draw.worldUp = camera.up;
        const lod::View view = scene::makeView(camera, 320, 240, nearPlane);
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
        return state->image;
    }
    const test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::shared_ptr<const lod::Store> store_;
};

TEST_F(Placement, TurnedAndScaledStoresLookAsFromTheTurnedCamera) {
    scene::Camera camera;
    camera.eye = {2, 1.5, 2.5};
    camera.target = {0.1, 0, 0};
    camera.up = {0, 1, 0};
    const render::Image plain = draw({}, camera, 1e-3);
    lod::Instance place;
    place.rotation = glm::dmat3(glm::rotate(glm::dmat4(1), 1.1, glm::normalize(glm::dvec3(1, 2, -0.5))));
    place.scale = 3;
    place.translation = {1e6, -2e6, 5e5};
    const auto moved = [&](const glm::dvec3& p) { return place.translation + place.rotation * (place.scale * p); };
    scene::Camera turned = camera;
    turned.eye = moved(camera.eye);
    turned.target = moved(camera.target);
    turned.up = place.rotation * camera.up;
    const auto d = reference::compareImages(draw(place, turned, 3e-3), plain, 4, nullptr);
    ASSERT_TRUE(d);
    // Normals are stored anew along the turned axes (0.004 degrees), positions differ by the rounding of fp32.
    EXPECT_GE(d->psnr, 45);
    EXPECT_LE(d->differingFraction, 0.005);
    // Negative control: a store that stays where it is looks different from there.
    const auto control = reference::compareImages(draw({}, turned, 3e-3), plain, 4, nullptr);
    ASSERT_TRUE(control);
    EXPECT_LT(control->psnr, 30);
}

TEST_F(Placement, OneStoreManyTimesIsOneSetOfNodesAndManyPlaces) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    std::vector<render::PlacedStore> placed;
    for (int i = 0; i < 5; ++i) {
        lod::Instance place;
        place.translation = {3.0 * i, 0, 0};
        placed.push_back({store_, place, {}});
    }
    const auto state = render::makeFrameState(placed, *backend, *executor_, {});
    EXPECT_EQ(state->stores.size(), 1u);
    EXPECT_EQ(state->instances.size(), 5u);
}

TEST_F(Placement, ASceneFileNamesItsStores) {
    nlohmann::json node = {{"name", "here"}, {"translation", {1, 2, 3}}};
    node["extensions"]["STIPPLE_store"]["uri"] = "a.stipple";
    nlohmann::json root = {{"asset", {{"version", "2.0"}}}, {"extensionsUsed", {"STIPPLE_store"}}};
    root["nodes"] = {node};
    std::ofstream(folder_ / "scene.gltf") << root.dump();
    const auto scene = scene::readGltf(folder_ / "scene.gltf");
    ASSERT_TRUE(scene) << scene.error().line();
    ASSERT_EQ(scene->nodes.size(), 1u);
    EXPECT_EQ(scene->nodes[0].store, folder_ / "a.stipple");
    EXPECT_EQ(glm::dvec3(scene->worldTransforms()[0][3]), glm::dvec3(1, 2, 3));
}

}  // namespace
}  // namespace stipple
