// The gpu backend on whatever Vulkan there is (CI: llvmpipe), always with core and synchronization validation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>

#include "engine/cpu/cpu_backend.h"
#include "engine/gpu/gpu_backend.h"
#include "engine/gpu/pages.h"
#include "engine/gpu/pass_list.h"
#include "engine/gpu/shader_table.h"
#include "engine/reference/reference.h"
#include "engine/render/frame_passes.h"
#include "engine/scene/camera.h"
#include "lod/builder/weights/add.h"
#include "tests/gpu/one_time_commands.h"
#include "tests/support/curves.h"
#include "tests/support/forests.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple::gpu {
namespace {

class Gpu : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(60'000, 1));
        store_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_, 1024);
    }
    std::unique_ptr<render::Backend> make() {
        GpuSettings settings;
        settings.validation = true;
        auto backend = makeGpuBackend(settings);
        if (!backend) throw std::runtime_error(backend.error().line());
        return std::move(*backend);
    }
    render::Image draw(render::Backend& backend, const render::FrameSettings& settings, uint32_t w = 400,
                       uint32_t h = 300) {
        return test::renderView(store_, backend, *executor_, test::fitView(*store_, w, h), settings);
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    std::shared_ptr<const lod::Store> store_;
};

TEST_F(Gpu, DrawsAsTheOracleDrawsAndValidationIsSilent) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    for (const render::Mode mode : {render::Mode::surface, render::Mode::pullpush, render::Mode::splat,
                                    render::Mode::ewa, render::Mode::points, render::Mode::pullpushExact})
        for (const double tau : {0.25, 2.0, 32.0})
            for (const uint32_t debug : {shared::kDebugNone, shared::kDebugLevel, shared::kDebugError,
                                         shared::kDebugHoles, shared::kDebugNormals}) {
                render::FrameSettings settings;
                settings.mode = mode;
                settings.budgets.errorPixels = tau;
                settings.draw.lit = true;
                settings.draw.debugView = debug;
                const auto d = reference::compareImages(draw(*gpu, settings), draw(*oracle, settings), 4, nullptr);
                ASSERT_TRUE(d);
                EXPECT_LE(d->differingFraction, debug == shared::kDebugHoles ? 0.005 : 0.001)
                    << "tau " << tau << " debug " << debug;
                if (debug == shared::kDebugNone) EXPECT_GE(d->psnr, 50) << "tau " << tau;
            }
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

/// Depth, normals and coverage of two pictures of one view.
void expectSameSurface(const render::Image& a, const render::Image& b, const lod::View& view, double mostDepth) {
    std::vector<double> depth, lean;
    size_t uncovered = 0;
    for (size_t i = 0; i < a.depth.size(); ++i) {
        uncovered += (a.depth[i] > 0) != (b.depth[i] > 0);
        if (!(a.depth[i] > 0 && b.depth[i] > 0)) continue;
        depth.push_back(std::abs(a.depth[i] - b.depth[i]) * view.focalPixels / b.depth[i]);
        double cosine = 0;
        for (size_t c = 0; c < 3; ++c) cosine += double{a.normal[3 * i + c]} * double{b.normal[3 * i + c]};
        lean.push_back(std::acos(std::min(cosine, 1.0)) * 180 / M_PI);
    }
    ASSERT_GT(depth.size(), 10000u);
    std::sort(depth.begin(), depth.end());
    std::sort(lean.begin(), lean.end());
    EXPECT_LE(depth[depth.size() * 99 / 100], mostDepth) << "pixels";
    EXPECT_LE(lean[lean.size() * 99 / 100], 0.2) << "degrees";
    EXPECT_LE(uncovered, depth.size() / 1000) << "pixels";
}

TEST_F(Gpu, DepthNormalsAndCoverageOfPointsAreTheOracles) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    settings.wantDepthAndNormal = true;
    for (const double tau : {0.25, 4.0}) {
        SCOPED_TRACE(testing::Message() << "tau " << tau);
        settings.budgets.errorPixels = tau;
        const lod::View view = test::fitView(*store_, 400, 300);
        expectSameSurface(test::renderView(store_, *gpu, *executor_, view, settings),
                          test::renderView(store_, *oracle, *executor_, view, settings), view, 0.05);
    }
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, BlendedDiscsAreTheOraclesFromAfarFromNearAndOrthographic) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    settings.mode = render::Mode::ewa;
    settings.wantDepthAndNormal = true;
    const lod::View whole = test::fitView(*store_, 400, 300);
    const double away = glm::length(whole.eye);
    lod::View flat = whole, near = whole;
    flat.isOrthographic = true;
    flat.focalPixels /= away;
    const double middle = double{test::renderView(store_, *oracle, *executor_, whole, settings).depth[150 * 400 + 200]};
    near.eye += near.forward * (0.99 * middle);  // discs of hundreds of pixels
    for (const lod::View& view : {whole, flat, near})
        for (const double tau : {0.25, 4.0}) {
            const float support = tau < 1 ? 3 : 2;
            settings.budgets.errorPixels = tau;
            settings.draw.kernelSupport = support;
            const render::Image a = test::renderView(store_, *gpu, *executor_, view, settings),
                                b = test::renderView(store_, *oracle, *executor_, view, settings);
            SCOPED_TRACE(testing::Message() << view.isOrthographic << ", tau " << tau << ", support " << support);
            lod::View pixels = view;  // depths are compared in pixels at where they are
            if (view.isOrthographic) pixels.focalPixels *= away;
            expectSameSurface(a, b, pixels, 0.1);
            EXPECT_GE(test::drawnPsnr(a, b), 50);
            size_t coverage = 0;
            for (size_t i = 0; i < a.rgba.size(); ++i)
                coverage += std::abs(static_cast<int>(a.rgba[i] >> 24) - static_cast<int>(b.rgba[i] >> 24)) > 2;
            EXPECT_LE(coverage, a.rgba.size() / 1000);
            const render::Image again = test::renderView(store_, *gpu, *executor_, view, settings);
            EXPECT_TRUE(a.rgba == again.rgba && a.depth == again.depth) << "whatever the order of threads";
        }
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

/// With weights of surfels behind the records of each chunk; some discs are so wide that workgroups share them out.
TEST_F(Gpu, SurfelsThatAreWeighedAreTheOracles) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    test::writePly(folder_ / "w.ply", test::bumpySphere(9'000, 7));
    test::build({folder_ / "w.ply"}, folder_ / "w.stipple", *executor_);
    Progress silent(false);
    ASSERT_TRUE(lod::addSurfelWeights(folder_ / "w.stipple", *executor_, silent));
    const auto store = std::make_shared<const lod::Store>(std::move(*lod::openStore(folder_ / "w.stipple")));
    render::FrameSettings settings;
    settings.mode = render::Mode::ewa;
    settings.wantDepthAndNormal = true;
    const lod::View whole = test::fitView(*store, 400, 300);
    lod::View near = whole;
    near.eye += near.forward * (0.7 * glm::length(whole.eye));
    for (const lod::View& view : {whole, near})
        for (const double tau : {0.25, 4.0}) {
            SCOPED_TRACE(testing::Message() << "tau " << tau);
            settings.budgets.errorPixels = tau;
            settings.draw.kernelSupport = tau < 1 ? 3 : 2;
            settings.draw.perSurfel = true;
            const render::Image a = test::renderView(store, *gpu, *executor_, view, settings),
                                b = test::renderView(store, *oracle, *executor_, view, settings);
            expectSameSurface(a, b, view, 0.1);
            EXPECT_GE(test::drawnPsnr(a, b), 50);
            settings.draw.perSurfel = false;
            EXPECT_LT(test::drawnPsnr(test::renderView(store, *gpu, *executor_, view, settings), b), 50);
        }
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, FromNearDiscsThatFillThePictureAreTheOraclesToo) {
    const auto gpu = make();
    const auto cpu = cpu::makeCpuBackend(*executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    settings.wantDepthAndNormal = true;
    lod::View view = test::fitView(*store_, 400, 300);
    const render::Image far = test::renderView(store_, *oracle, *executor_, view, settings);
    const size_t middle = 150 * 400 + 200;
    ASSERT_GT(far.depth[middle], 0);
    const glm::dvec3 surface = view.eye + view.forward * double{far.depth[middle]};
    for (const double share : {0.03, 0.01, 0.002}) {
        SCOPED_TRACE(testing::Message() << share << " of the way");
        view.eye = surface - view.forward * (share * double{far.depth[middle]});
        const render::Image exact = test::renderView(store_, *oracle, *executor_, view, settings);
        for (render::Backend* backend : {gpu.get(), cpu.get()}) {
            SCOPED_TRACE(backend->name());
            expectSameSurface(test::renderView(store_, *backend, *executor_, view, settings), exact, view,
                              0.1);  // of splats a hundred pixels wide
            const auto& times = backend->passTimes();
            EXPECT_TRUE(std::any_of(times.begin(), times.end(), [](const auto& t) { return t.name == "discs"; }));
        }
    }
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, DrawsMeshesAndHybridScenesAsTheOracleDoesAndOnlyThenHasWhatTheyNeed) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    draw(*gpu, settings);  // points alone
    EXPECT_EQ(gpu->resources().meshPipelines, 0u);
    EXPECT_EQ(gpu->resources().meshBytes, 0u);
    for (const char* kind : {"rock", "building", "terrain"}) {
        test::MeshRecipe recipe;
        recipe.grow.kind = kind;
        recipe.grow.triangles = 30'000;
        recipe.grow.textureSize = 512;
        const auto mesh = test::growMeshStore(recipe, folder_ / "b.stipple", *executor_);
        const double size = glm::length(mesh->description.boundsMax - mesh->description.boundsMin);
        lod::Instance place;
        place.scale = 3 / size;  // about as large as the points, which it intersects
        const std::vector<render::PlacedStore> placed{{store_, {}, {}}, {mesh, place, {}}};
        lod::View view = test::fitView(*store_, 400, 300);
        for (const double closer : {0.0, 2.2}) {  // the second has parts in front of the near plane
            view.eye += closer * view.forward;
            for (const bool hasLights : {false, true}) {
                settings.draw.lights.clear();
                if (hasLights) settings.draw.lights = {{shared::kLightPoint, {2, 2, 2}, {0, -1, 0}, glm::vec3(20)}};
                const auto image = [&](render::Backend& backend) {
                    auto state = render::makeFrameState(placed, backend, *executor_, {});
                    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
                    return state->image;
                };
                const auto d = reference::compareImages(image(*gpu), image(*oracle), 4, nullptr);
                ASSERT_TRUE(d);
                EXPECT_GE(d->psnr, 50) << kind << ", closer " << closer;
                EXPECT_LE(d->differingFraction, 0.002) << kind << ", closer " << closer;
            }
        }
    }
    EXPECT_EQ(gpu->resources().meshPipelines, 3u);
    EXPECT_EQ(gpu->resources().lightPipelines, 1u);
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, DrawsRibbonsAndTubesAmongPointsAsTheOracleDoes) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    settings.draw.lit = true;
    draw(*gpu, settings);  // points alone
    EXPECT_EQ(gpu->resources().curvePipelines, 0u);
    EXPECT_EQ(gpu->resources().curveBytes, 0u);
    for (const float radius : {0.002f, 0.01f, 0.05f}) {
        test::CurlRecipe recipe;
        recipe.radius = radius;
        const auto curves = test::buildCurves(test::curls(recipe), folder_ / "c.stipple", *executor_);
        lod::Instance turned;
        turned.rotation = glm::dmat3(glm::dvec3(0, 0, -1), glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0));
        const std::vector<render::PlacedStore> placed{{store_, {}, {}}, {curves, turned, {}}};
        lod::View view = test::fitView(*store_, 400, 300);
        for (const double closer : {0.0, 2.2})
            for (const float exact : {2.0f, 1e9f}) {
                view.eye += closer * view.forward;
                settings.draw.exactCurves = exact;
                settings.wantDepthAndNormal = exact > 3;
                const auto image = [&](render::Backend& backend) {
                    auto state = render::makeFrameState(placed, backend, *executor_, {});
                    EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
                    return state->image;
                };
                const auto d = reference::compareImages(image(*gpu), image(*oracle), 4, nullptr);
                ASSERT_TRUE(d);
                EXPECT_GE(d->psnr, exact > 3 ? 33 : 42) << radius << ", closer " << closer << ", exact " << exact;
                EXPECT_LE(d->differingFraction, 0.008) << radius << ", closer " << closer << ", exact " << exact;
                view.eye -= closer * view.forward;
            }
    }
    // Trees from near and far: discs of leaves beside curves.
    const test::Forest forest = test::plantForest(folder_.path(), 6, *executor_);
    for (const glm::dvec3& eye : {glm::dvec3(20, 4, 60), glm::dvec3(20, 60, 400)}) {
        scene::Camera camera;
        camera.eye = eye;
        camera.target = {20, 6, 20};
        camera.up = {0, 1, 0};
        const lod::View view = scene::makeView(camera, 400, 300, 0.05);
        settings.draw.exactCurves = 2;
        settings.budgets.errorPixels = 2;
        const auto image = [&](render::Backend& backend) {
            auto state = render::makeFrameState(forest.placed, backend, *executor_, {}, forest.groups);
            EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
            return state->image;
        };
        const auto d = reference::compareImages(image(*gpu), image(*oracle), 4, nullptr);
        ASSERT_TRUE(d);
        EXPECT_GE(d->psnr, 38) << eye.y;
        EXPECT_LE(d->differingFraction, 0.01) << eye.y;
    }
    EXPECT_EQ(gpu->resources().curvePipelines, 3u);
    EXPECT_GT(gpu->resources().curveBytes, 0u);
    EXPECT_EQ(gpu->resources().meshPipelines, 0u) << "curves call for no pipeline of triangles";
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, OddSizesAndDepthAndNormals) {
    const auto gpu = make();
    const auto oracle = reference::makeReferenceBackend(*executor_);
    render::FrameSettings settings;
    settings.wantDepthAndNormal = true;
    // Up to 4,096 texels one workgroup has all of the pyramid; with large splats all of its levels count.
    for (const auto& [w, h, tau] : {std::tuple{1u, 1u, 1.0},
                                    {1u, 7u, 1.0},
                                    {7u, 1u, 1.0},
                                    {2u, 3u, 1.0},
                                    {321u, 243u, 1.0},
                                    {64u, 64u, 8.0},
                                    {65u, 64u, 8.0},
                                    {31u, 132u, 8.0},
                                    {321u, 243u, 32.0}}) {
        settings.budgets.errorPixels = tau;
        const render::Image a = draw(*gpu, settings, w, h), b = draw(*oracle, settings, w, h);
        const auto d = reference::compareImages(a, b, 4, nullptr);
        EXPECT_LE(d->differingFraction * w * h, 1 + 0.001 * w * h) << w << " x " << h;
        size_t off = 0;
        for (size_t i = 0; i < a.depth.size(); ++i)
            off += std::abs(a.depth[i] - b.depth[i]) > 1e-3f * b.depth[i] + 1e-6f;
        EXPECT_LE(off, 2 + a.depth.size() / 500);
    }
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, AFrameWithoutPointsShowsNothingOfThoseBefore) {
    // No pull and no push run in it: the levels of the pyramid are those of the frame before.
    const auto gpu = make();
    lod::View view = test::fitView(*store_, 160, 120);
    const render::Image first = test::renderView(store_, *gpu, *executor_, view, {});
    EXPECT_GT(std::count_if(first.rgba.begin(), first.rgba.end(), [](uint32_t c) { return c >> 24 != 0; }), 1000);
    view.forward = -view.forward;
    view.right = -view.right;
    const render::Image away = test::renderView(store_, *gpu, *executor_, view, {});
    EXPECT_EQ(std::count_if(away.rgba.begin(), away.rgba.end(), [](uint32_t c) { return c >> 24 != 0; }), 0);
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST(Validation, ADeliberateHazardIsReported) {
    // Without this, silence above would prove nothing: the layer ignores misspelt settings. Two fills of a buffer, the
    // second of which does not say that it writes it, so that there is no barrier between them.
    const auto hazards = [](bool saysSo) {
        auto made = Device::create({"", true, {}, {}});
        EXPECT_TRUE(made) << made.error().line();
        const Device& device = **made;
        auto buffer = Buffer::create(device, 4096, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::device, "filled twice");
        EXPECT_TRUE(buffer);
        OneTimeCommands commands(device);
        VkQueryPoolCreateInfo query{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
        query.queryType = VK_QUERY_TYPE_TIMESTAMP;
        query.queryCount = 4;
        VkQueryPool queries{};
        EXPECT_EQ(vkCreateQueryPool(device.device, &query, nullptr, &queries), VK_SUCCESS);
        vkResetQueryPool(device.device, queries, 0, 4);
        PassList list(device, commands.handle(), queries);
        for (const bool isSecond : {false, true}) {
            std::vector<BufferUse> uses;
            if (!isSecond || saysSo) uses.push_back({buffer->handle(), true});
            list.begin(isSecond ? "second" : "first", uses, true);
            vkCmdFillBuffer(commands.handle(), buffer->handle(), 0, VK_WHOLE_SIZE, isSecond ? 2 : 1);
            list.end();
        }
        commands.end();
        const std::vector<std::string> messages = device.messages();
        vkDestroyQueryPool(device.device, queries, nullptr);
        return std::count_if(messages.begin(), messages.end(),
                             [](const std::string& m) { return m.find("SYNC-HAZARD") != std::string::npos; });
    };
    EXPECT_EQ(hazards(true), 0) << "with a barrier between them";
    EXPECT_GT(hazards(false), 0) << "a missing barrier went unseen: synchronization validation is off";
}

TEST_F(Gpu, FramesInFlightAreThoseOfEachAlone) {
    const auto gpu = make();
    auto state = render::makeFrameState({store_}, *gpu, *executor_, {});
    const lod::View near = test::fitView(*store_, 320, 240);
    lod::View aside = near;
    aside.eye += 0.3 * near.right;
    const auto pictureOf = [&](const lod::View& view) {
        EXPECT_TRUE(render::renderUntilComplete(*state, view, {}));
        return state->image.rgba;
    };
    const std::vector<uint32_t> first = pictureOf(near), second = pictureOf(aside);
    ASSERT_TRUE(first != second);
    std::vector<render::Ticket> tickets;
    for (const lod::View* view : std::initializer_list<const lod::View*>{&near, &aside, &near}) {
        lod::selectCut(state->scene(), state->streamer->residency(), *view, {}, state->scratch, state->cut);
        render::makeDrawList(state->cut, state->hierarchies, state->instances, *view, {}, state->draws);
        render::markDiscSizes(*state->discSizes, state->draws);
        render::RenderRequest request;
        request.draws = &state->draws;
        request.passes = render::passesOf(request.mode, render::contentOf(state->draws), state->draws.effects);
        const auto ticket = gpu->submit(request);
        ASSERT_TRUE(ticket);
        tickets.push_back(*ticket);
    }
    render::Image image;
    EXPECT_FALSE(gpu->read(tickets[0], image)) << "two are in flight: the oldest was given up";
    ASSERT_TRUE(gpu->read(tickets[2], image));
    EXPECT_TRUE(gpu->isDone(tickets[1])) << "the queue is in order";
    EXPECT_TRUE(image.rgba == first);
    ASSERT_TRUE(gpu->read(tickets[1], image));
    EXPECT_TRUE(image.rgba == second);
    EXPECT_FALSE(gpu->read(tickets[1], image)) << "once";
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST_F(Gpu, WhatNoEffectCallsForIsNotThere) {
    const auto gpu = make();
    render::FrameSettings dark;
    dark.draw.lights.push_back({});
    render::HdrImage sky{8, 4, std::vector<float>(96, 0.5f)};
    dark.draw.environment = std::make_shared<const render::Environment>(render::makeEnvironment(sky, 1, *executor_));
    render::FrameSettings lit = dark;
    lit.draw.lit = true;
    draw(*gpu, dark);
    EXPECT_EQ(gpu->resources().lightPipelines, 0u);
    EXPECT_EQ(gpu->resources().effectBytes, 0u);
    draw(*gpu, lit);
    EXPECT_EQ(gpu->resources().lightPipelines, 1u);
    EXPECT_GT(gpu->resources().effectBytes, 0u);
    for (const std::string& message : validationMessages(*gpu)) ADD_FAILURE() << message;
}

TEST(Shaders, TouchThePlanesThatTheirPassesDeclare) {
    // What a pass's shaders read and write (SPIR-V) against passes.inl.
    using render::Pass;
    using render::Plane;
    const std::map<Pass, std::vector<std::string>> shadersOf{
        {Pass::smooth, {"project", "disc_order", "discs", "pyramid_levels", "pull", "pull_tail", "push"}},
        {Pass::project, {"project"}},
        {Pass::discs, {"disc_order", "discs"}},
        {Pass::splat, {"splat", "discs"}},
        {Pass::exact, {"exact_depths", "exact_ids", "exact_rest", "discs", "exact_gather"}},
        {Pass::ewa,
         {"ewa_front", "ewa_front_wide", "ewa_begin", "ewa_sum", "ewa_sum_wide", "ewa_show", "ewa_cover", "ewa_behind",
          "ewa_behind_wide", "ewa_second_begin", "ewa_second_sum", "ewa_second_sum_wide", "ewa_second_show"}},
        {Pass::curves, {"curves", "curves_wide"}},
        {Pass::rasterise, {"rasterise", "rasterise_large"}},
        {Pass::resolve, {"resolve", "disc_texels", "curve_texels", "triangle_texels"}},
        {Pass::pull, {"pyramid_levels", "pull", "pull_tail"}},
        {Pass::push, {"push"}},
        {Pass::surface, {"surface"}},
        {Pass::output, {"output"}}};
    const std::map<uint32_t, render::Planes> planesOf{
        {shared::kVisibilityBinding, {Plane::visibility}},
        {shared::kDiscsBinding, {Plane::discList}},
        {shared::kFrontsBinding, {Plane::filtered}},
        {shared::kSumsBinding, {Plane::filtered}},
        {shared::kMaterialSumsBinding, {Plane::filtered}},
        {shared::kFilteredBinding, {Plane::filtered}},
        {shared::kCoverageBinding, {Plane::filtered}},
        {shared::kSecondGroupsBinding, {Plane::filtered}},
        {shared::kTexelsBinding, {Plane::texels, Plane::coarse, Plane::smooth, Plane::behind}},  // one room
        {shared::kTriangleWordsBinding, {Plane::texels}},
        {shared::kSurfaceBinding, {Plane::surface}},
        {shared::kImageBinding, {Plane::image}}};
    size_t compared = 0;
    for (const auto& [pass, names] : shadersOf) {
        const render::PassInfo& info = render::passInfo(pass);
        for (const std::string& name : names) {
            const Shader* const shader = shaderNamed(name);
            ASSERT_NE(shader, nullptr) << name;
            for (const BindingUse& use : shader->uses) {
                const auto planes = planesOf.find(use.binding);
                if (planes == planesOf.end()) continue;
                ++compared;
                const uint32_t own = info.writes.bits;  // what is drawn into by atomic minimum reads its own past
                if (use.writes)
                    EXPECT_NE(planes->second.bits & own, 0u) << info.name << ": " << name << " writes " << use.binding;
                if (use.reads)
                    EXPECT_NE(planes->second.bits & (info.reads.bits | own), 0u)
                        << info.name << ": " << name << " reads " << use.binding;
            }
        }
    }
    EXPECT_GT(compared, 20u);
}

TEST(Shaders, OverPixelsWorkOnTiles) {
    // Neighbours read the same records and texels, above and below, too. One reads its row alone; others are a group
    // of records, which none of 64 threads is.
    size_t tiles = 0;
    for (const Shader& shader : shaders()) {
        if (shader.group[0] * shader.group[1] != shared::kPixelTile * shared::kPixelTile) continue;
        const bool readsItsRow = std::string(shader.name) == "occlusion_mean_across";
        EXPECT_EQ(shader.group[1], readsItsRow ? 1u : shared::kPixelTile) << shader.name;
        ++tiles;
    }
    EXPECT_GT(tiles, 20u);
}

TEST(RangeAllocator, NeverOverlapsAndMergesAll) {
    Rng rng(1);
    RangeAllocator ranges(1 << 16);
    std::map<uint64_t, uint64_t> taken;
    for (int i = 0; i < 20'000; ++i) {
        if (rng.below(2) && !taken.empty()) {
            auto it = std::next(taken.begin(), static_cast<std::ptrdiff_t>(rng.below(taken.size())));
            ranges.release(it->first, it->second);
            taken.erase(it);
            continue;
        }
        const uint64_t bytes = 1 + rng.below(2000), at = ranges.allocate(bytes);
        if (at == ~uint64_t{0}) continue;
        const auto next = taken.lower_bound(at);
        ASSERT_TRUE(next == taken.end() || next->first >= at + bytes);
        if (next != taken.begin()) ASSERT_LE(std::prev(next)->first + std::prev(next)->second, at);
        ASSERT_LE(at + bytes, uint64_t{1} << 16);
        taken[at] = bytes;
    }
    for (const auto& [at, bytes] : taken) ranges.release(at, bytes);
    EXPECT_EQ(ranges.freeBytes(), uint64_t{1} << 16);
    EXPECT_EQ(ranges.freeRanges(), 1u);
}

}  // namespace
}  // namespace stipple::gpu
