// Triangles in pictures: as the fp64 oracle draws them, with points in one reconstruction, and at no cost where there
// are none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/kernels.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"
#include "engine/scene/camera.h"
#include "engine/scene/surfels.h"
#include "engine/scene/triangles.h"
#include "shaders/shared/environment.h"
#include "tests/support/meshes.h"

namespace stipple {
namespace {

using test::draw;

/// Had the last frame this pass?
bool had(const render::Backend& backend, const std::string& pass) {
    const auto& times = backend.passTimes();
    return std::any_of(times.begin(), times.end(), [&](const render::PassTime& t) { return t.name == pass; });
}

std::vector<render::WorldLight> threeLights(const glm::dvec3& at, double size) {
    std::vector<render::WorldLight> lights(3);
    lights[0].kind = shared::kLightDirectional;
    lights[0].direction = glm::normalize(glm::dvec3(0.3, -1, -0.2));
    lights[0].colour = {1.5f, 1.4f, 1.2f};
    lights[1].position = at + glm::dvec3(size, size, size);
    lights[1].colour = glm::vec3(0.5f, 0.8f, 2.0f) * static_cast<float>(size * size);
    lights[1].range = static_cast<float>(4 * size);
    lights[2].kind = shared::kLightSpot;
    lights[2].position = at + glm::dvec3(-size, 0.5 * size, size);
    lights[2].direction = glm::normalize(glm::dvec3(1, -0.5, -1));
    lights[2].colour = glm::vec3(4, 1, 1) * static_cast<float>(size * size);
    lights[2].innerCone = 0.2f;
    lights[2].outerCone = 0.4f;
    return lights;
}

TEST(MeshImages, AreThoseOfTheOracleOnEveryInstructionSet) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto oracle = reference::makeReferenceBackend(*executor);
    for (const char* kind : {"rock", "building", "terrain"}) {
        test::MeshRecipe recipe;
        recipe.grow.kind = kind;
        recipe.grow.triangles = 50'000;
        recipe.grow.textureSize = 512;
        const auto store = test::growMeshStore(recipe, folder / "a.stipple", *executor);
        const glm::dvec3 centre = 0.5 * (store->description.boundsMin + store->description.boundsMax);
        const double size = glm::length(store->description.boundsMax - store->description.boundsMin);
        lod::View fit = test::fitView(*store, 401, 303), close = fit;
        close.eye = centre + 0.35 * (fit.eye - centre);  // parts behind the eye, parts in front of the near plane
        for (const lod::View& view : {fit, close})
            for (const double tau : {0.25, 8.0})
                for (const bool hasLights : {false, true}) {
                    render::FrameSettings settings;
                    settings.budgets.errorPixels = tau;
                    if (hasLights) settings.draw.lights = threeLights(centre, 0.5 * size);
                    const render::Image expected = draw({{store, {}, {}}}, *oracle, *executor, view, settings);
                    size_t count = 0;
                    const cpu::Kernels* const* all = cpu::availableKernels(count);
                    for (size_t k = 0; k < count; ++k) {
                        const auto backend = cpu::makeCpuBackend(*executor, all[k]);
                        const auto d = reference::compareImages(
                            draw({{store, {}, {}}}, *backend, *executor, view, settings), expected, 4, nullptr);
                        ASSERT_TRUE(d);
                        EXPECT_GE(d->psnr, 55) << kind << ", " << all[k]->name << ", tau " << tau;
                        EXPECT_LE(d->differingFraction, 0.001) << kind << ", " << all[k]->name << ", tau " << tau;
                        EXPECT_GE(d->silhouetteIou, 0.9999);
                    }
                }
    }
}

/// A scan with a boulder in it, as one hybrid scene.
class Hybrid : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(60'000, 1));
        points_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, 1024);
        test::MeshRecipe recipe;
        recipe.grow.triangles = 40'000;
        recipe.grow.textureSize = 256;
        mesh_ = test::growMeshStore(recipe, folder_ / "b.stipple", *executor_);
        lod::Instance place;
        place.scale = 0.6;
        place.translation = {0.75, -0.2, 0.5};
        placed_ = {{points_, {}, {}}, {mesh_, place, {}}};
        view_ = test::fitView(*points_, 480, 360);
        view_.eye += 1.0 * view_.forward;
        settings_.draw.lit = true;
        settings_.draw.worldUp = {0, 1, 0};
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    std::shared_ptr<const lod::Store> points_, mesh_;
    std::vector<render::PlacedStore> placed_;
    lod::View view_;
    render::FrameSettings settings_;
};

TEST_F(Hybrid, PointsAndTrianglesOccludeEachOtherAsTheOracleSays) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Mode mode :
         {render::Mode::surface, render::Mode::pullpush, render::Mode::splat, render::Mode::points}) {
        settings_.mode = mode;
        const auto d = reference::compareImages(draw(placed_, *backend, *executor_, view_, settings_),
                                                draw(placed_, *oracle, *executor_, view_, settings_), 4, nullptr);
        ASSERT_TRUE(d);
        EXPECT_GE(d->psnr, 50);
        EXPECT_LE(d->differingFraction, 0.001);
    }
    // A triangle's pixel in front of the points is the pixel of the mesh alone, to the last bit.
    settings_.mode = render::Mode::pullpush;
    settings_.wantDepthAndNormal = true;
    const render::Image both = draw(placed_, *backend, *executor_, view_, settings_);
    const render::Image mesh = draw({placed_[1]}, *backend, *executor_, view_, settings_);
    const render::Image points = draw({placed_[0]}, *backend, *executor_, view_, settings_);
    size_t inFront = 0, behind = 0;
    for (size_t i = 0; i < both.rgba.size(); ++i) {
        if (mesh.depth[i] > 0 && (points.depth[i] <= 0 || mesh.depth[i] < 0.9f * points.depth[i])) {
            ++inFront;
            EXPECT_EQ(both.rgba[i], mesh.rgba[i]);
        } else if (mesh.depth[i] > 0 && points.depth[i] < 0.9f * mesh.depth[i]) {
            ++behind;
            EXPECT_NE(both.depth[i], mesh.depth[i]);
        }
    }
    EXPECT_GT(inFront, 1000u);
    EXPECT_GT(behind, 1000u);
}

TEST_F(Hybrid, StandsInDepthAsTracedRaysSay) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    settings_.wantDepthAndNormal = true;
    settings_.budgets.errorPixels = 1e-4;
    const render::Image drawn = draw(placed_, *backend, *executor_, view_, settings_);
    reference::TraceSettings trace;
    trace.draw = settings_.draw;
    const auto smooth = reference::trace(placed_, view_, trace, *executor_);
    ASSERT_TRUE(smooth);
    // All of this is an error of reconstruction: that of the implementation is 50 dB and more (the test above), and the
    // cut draws the leaves. Discs just close the surface: where its rim is seen through their edges a few pixels are
    // open (measured: 4).
    EXPECT_LE(reference::compareImages(drawn, *smooth, 4, nullptr)->holes, 4u);
    trace.samplesPerAxis = 1;
    const auto traced = reference::trace(placed_, view_, trace, *executor_);
    ASSERT_TRUE(traced);
    const auto d = reference::compareImages(drawn, *traced, 4, nullptr);
    ASSERT_TRUE(d);
    EXPECT_GE(d->silhouetteIou, 0.99);
    EXPECT_GE(d->foregroundPsnr, 28.8);  // measured: 28.9
    const double size = glm::length(points_->description.boundsMax - points_->description.boundsMin);
    const auto apart = [&](const render::Image& a) {
        size_t both = 0, differ = 0;
        for (size_t i = 0; i < a.depth.size(); ++i) {
            if (a.depth[i] <= 0 || traced->depth[i] <= 0) continue;
            ++both;
            differ += std::abs(a.depth[i] - traced->depth[i]) > 0.02 * size ? 1 : 0;
        }
        return static_cast<double>(differ) / static_cast<double>(both);
    };
    // What differs lies along silhouettes, where one ray meets the nearer surface and the splat does not, or the
    // reverse.
    EXPECT_LE(apart(drawn), 0.0005);
    // Negative control: without the mesh in front the depths are others.
    EXPECT_GE(apart(draw({placed_[0]}, *backend, *executor_, view_, settings_)), 0.05);
}

TEST(MeshImages, AreThoseThatRaysTrace) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(0);
    const auto backend = cpu::makeCpuBackend(*executor);
    for (const char* kind : {"rock", "building", "terrain"}) {
        test::MeshRecipe recipe;
        recipe.grow.kind = kind;
        recipe.grow.triangles = 20'000;
        recipe.grow.textureSize = 512;
        const auto store = test::growMeshStore(recipe, folder / "a.stipple", *executor);
        const lod::View view = test::fitView(*store, 401, 303);
        render::FrameSettings settings;
        settings.budgets.errorPixels = 1e-4;
        settings.draw.lights = threeLights(0.5 * (store->description.boundsMin + store->description.boundsMax), 1);
        reference::TraceSettings trace;
        trace.samplesPerAxis = 1;
        trace.draw = settings.draw;
        // A turned and scaled place, so that rays go through one.
        lod::Instance place;
        place.scale = 1.25;
        place.rotation = glm::dmat3(glm::dvec3(0, 0, -1), glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0));
        const auto traced = reference::trace({{store, place, {}}}, view, trace, *executor);
        ASSERT_TRUE(traced);
        const auto d = reference::compareImages(draw({{store, place, {}}}, *backend, *executor, view, settings),
                                                *traced, 8, nullptr);
        ASSERT_TRUE(d);
        EXPECT_GE(d->foregroundPsnr, 40) << kind;
        EXPECT_LE(d->differingFraction, 0.002) << kind;
        EXPECT_GE(d->silhouetteIou, 0.999) << kind;
    }
}

TEST_F(Hybrid, GoldenLooksAsItDid) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    const render::Image image = draw(placed_, *backend, *executor_, view_, settings_);
    test::expectGolden(image, "hybrid");
}

TEST_F(Hybrid, WhatASceneDoesNotCallForDoesNotExist) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    FrameCounters counters;
    draw({placed_[0]}, *backend, *executor_, view_, settings_, &counters);  // points alone
    EXPECT_TRUE(had(*backend, "project"));
    EXPECT_FALSE(had(*backend, "rasterise"));
    EXPECT_EQ(counters.trianglesDrawn, 0u);
    EXPECT_EQ(backend->resources().meshBytes, 0u);
    EXPECT_EQ(backend->resources().emissiveBytes, 0u);
    EXPECT_EQ(backend->resources().textureTiles, 0u);
    test::MeshRecipe plain;
    plain.grow.triangles = 20'000;
    plain.isTextured = false;
    const auto untextured = test::growMeshStore(plain, folder_ / "c.stipple", *executor_);
    EXPECT_EQ(untextured->hierarchy.tiles.size(), 0u);
    draw({{untextured, {}, {}}}, *backend, *executor_, view_, settings_, &counters);  // no textures, no points
    EXPECT_TRUE(had(*backend, "rasterise"));
    for (const char* pass : {"project", "curves", "pull", "push"}) EXPECT_FALSE(had(*backend, pass)) << pass;
    EXPECT_EQ(counters.recordsDrawn, 0u);
    EXPECT_GT(backend->resources().meshBytes, 0u);
    EXPECT_EQ(backend->resources().emissiveBytes, 0u);
    EXPECT_EQ(backend->resources().textureTiles, 0u);
    draw({placed_[1]}, *backend, *executor_, view_, settings_, &counters);
    EXPECT_FALSE(had(*backend, "pull"));
    EXPECT_EQ(backend->resources().textureTiles, 0u) << "tiles outlive their frame state";
    draw(placed_, *backend, *executor_, view_, settings_, &counters);
    for (const char* pass : {"project", "rasterise", "resolve", "pull", "push", "surface+light+output"})
        EXPECT_TRUE(had(*backend, pass)) << pass;
    EXPECT_FALSE(had(*backend, "curves"));
}

TEST_F(Hybrid, LightsAndAnEnvironmentShineOnPointsAndTrianglesAsTheOracleSays) {
    render::HdrImage sky;  // a gradient with a sun
    sky.width = 64;
    sky.height = 32;
    for (uint32_t y = 0; y < sky.height; ++y)
        for (uint32_t x = 0; x < sky.width; ++x) {
            const bool isSun = x / 4 == 5 && y / 4 == 2;
            const auto up = static_cast<float>(y) / 32;
            for (const float c : {0.3f + 0.5f * up, 0.6f - 0.2f * up, 1.0f - 0.8f * up})
                sky.rgb.push_back(isSun ? 20.0f : c);
        }
    const auto environment =
        std::make_shared<const render::Environment>(render::makeEnvironment(sky, 1.0f, *executor_));
    const auto backend = cpu::makeCpuBackend(*executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::Image before;
    for (const int which : {0, 1, 2, 3}) {
        settings_.draw.environment = (which & 1) != 0 ? environment : nullptr;
        settings_.draw.lights.clear();
        if ((which & 2) != 0) settings_.draw.lights = threeLights({0, 0, 0}, 2);
        const render::Image a = draw(placed_, *backend, *executor_, view_, settings_);
        const auto d = reference::compareImages(a, draw(placed_, *oracle, *executor_, view_, settings_), 4, nullptr);
        ASSERT_TRUE(d);
        EXPECT_GE(d->psnr, 50) << which;
        EXPECT_LE(d->differingFraction, 0.002) << which;
        if (!before.rgba.empty()) {
            const auto changed = reference::compareImages(a, before, 4, nullptr);
            EXPECT_GT(changed->differingFraction, 0.2) << which;  // negative control: light matters
        }
        before = a;
    }
    // A white furnace: under even light a white, rough, not metallic surface sends back about what falls on it.
    std::fill(sky.rgb.begin(), sky.rgb.end(), 0.5f);
    const render::Environment even = render::makeEnvironment(sky, 1.0f, *executor_);
    const auto e = shared::environmentDiffuse(even.table.data(), shared::vec3(0.6f, 0.0f, 0.8f));
    const auto m = shared::environmentMirror(even.table.data(), shared::vec3(0, -1, 0), 0.4f, 0);
    EXPECT_NEAR(e.x, 0.5, 0.005);
    EXPECT_NEAR(m.y, 0.5, 0.005);
}

TEST(MeshImages, TexturesAndChunksStayWithinTheResidentBudget) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::MeshRecipe recipe;
    recipe.grow.kind = "terrain";
    recipe.grow.triangles = 60'000;
    recipe.grow.textureSize = 1024;
    const auto store = test::growMeshStore(recipe, folder / "a.stipple", *executor);
    const auto backend = cpu::makeCpuBackend(*executor);
    streaming::StreamSettings stream;
    stream.residentBytes = 4'000'000;
    auto state = render::makeFrameState({render::PlacedStore{store, {}, {}}}, *backend, *executor, stream);
    const glm::dvec3 lo = store->description.boundsMin, hi = store->description.boundsMax;
    scene::Camera camera;
    camera.eye = glm::dvec3(0.5 * (lo.x + hi.x), hi.y, 0.5 * (lo.z + hi.z));
    camera.up = {0, 1, 0};
    camera.fovDegrees = 25;
    render::FrameSettings settings;
    settings.budgets.errorPixels = 2;
    uint64_t most = 0;
    for (int k = 0; k < 60; ++k) {  // looks around, obliquely down
        camera.target = camera.eye + glm::dvec3(std::cos(0.2 * k), -0.6, std::sin(0.2 * k));
        const lod::View view = scene::makeView(camera, 320, 240, 0.1);
        ASSERT_TRUE(render::renderUntilComplete(*state, view, settings));
        most = std::max(most, state->counters.residentBytes);
    }
    EXPECT_LE(most, stream.residentBytes);
    EXPECT_GT(state->counters.evictions, 0u);
    EXPECT_GT(backend->resources().textureTiles, 0u);
}

}  // namespace
}  // namespace stipple
