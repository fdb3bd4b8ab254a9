// A frame has an effect where it is requested, where the scene could show it and where the frame does: elsewhere there
// is no pass, no table and no byte of it, and the picture is the one without.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/effects/table.h"
#include "engine/render/frame_passes.h"
#include "engine/render/length_unit.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"

namespace stipple::render {
namespace {

size_t placeOf(const std::string& name) {
    for (size_t e = 0; e < effects().size(); ++e)
        if (name == effects()[e]->name) return e;
    ADD_FAILURE() << "no effect is called " << name;
    return 0;
}

class Effects : public testing::Test {
  protected:
    std::shared_ptr<const lod::Store> points() {
        test::writePly(folder_ / "a.ply", test::bumpySphere(8'000, 1));
        return test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    }
    std::shared_ptr<const lod::Store> plants() {
        return test::buildCurves(test::curls({}), folder_ / "b.stipple", *executor_);
    }
    std::shared_ptr<const lod::Store> building() {
        test::MeshRecipe recipe;
        recipe.grow.kind = "building";
        recipe.grow.triangles = 5'000;
        recipe.grow.textureSize = 128;
        return test::growMeshStore(recipe, folder_ / "c.stipple", *executor_);
    }
    std::unique_ptr<FrameState> drawn(const std::shared_ptr<const lod::Store>& store, const FrameSettings& settings,
                                      double fartherTimes = 1) {
        auto state = makeFrameState({store}, *backend_, *executor_, {});
        setSway(settings.draw.wind, state->hierarchies, state->instances, {});
        lod::View view = test::fitView(*store, 200, 150);
        const glm::dvec3 middle = 0.5 * (store->description.boundsMin + store->description.boundsMax);
        view.eye = middle + fartherTimes * (view.eye - middle);
        EXPECT_TRUE(renderUntilComplete(*state, view, settings));
        return state;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::unique_ptr<Backend> backend_ = cpu::makeCpuBackend(*executor_);
};

TEST_F(Effects, OfWindThereIsNothingWhereNothingSways) {
    const size_t wind = placeOf("wind");
    FrameSettings calm, windy;
    windy.draw.wind = {0.3, 1.5, {1, 0, 0}};
    const auto stiff = drawn(points(), windy);
    EXPECT_FALSE(stiff->draws.effectsOfScene.has(wind)) << "points are no plants";
    const auto store = plants();
    const auto near = drawn(store, windy), still = drawn(store, calm), far = drawn(store, windy, 4000);
    EXPECT_TRUE(near->draws.effectsOfScene.has(wind));
    EXPECT_TRUE(near->draws.effects.has(wind));
    EXPECT_EQ(near->draws.bends.size(), near->draws.cut.size());
    EXPECT_GT(near->counters.nodesSwaying, 0u);
    EXPECT_TRUE(near->image.rgba != still->image.rgba);
    for (const FrameState* none : {stiff.get(), still.get(), far.get()}) {
        EXPECT_FALSE(none->draws.effects.has(wind));
        EXPECT_TRUE(none->draws.bends.empty());
        EXPECT_EQ(none->counters.nodesSwaying, 0u);
        EXPECT_GT(none->draws.cut.size(), 0u);
    }
    EXPECT_TRUE(drawn(store, calm, 4000)->image.rgba == far->image.rgba);
}

TEST_F(Effects, OfLightThereIsNothingWhereNothingIsLit) {
    const size_t light = placeOf("light"), environment = placeOf("environment");
    FrameSettings dark, lit;
    dark.draw.lights.push_back({});
    HdrImage sky{8, 4, std::vector<float>(96, 0.5f)};
    dark.draw.environment = std::make_shared<const Environment>(makeEnvironment(sky, 1, *executor_));
    dark.draw.unlitTriangles = true;
    lit = dark;
    lit.draw.lit = true;
    lit.draw.unlitTriangles = false;
    FrameSettings debug = lit;
    debug.draw.debugView = shared::kDebugNormals;
    for (const auto& store : {points(), building()}) {
        const auto without = drawn(store, dark), with = drawn(store, lit), shown = drawn(store, debug);
        for (const FrameState* none : {without.get(), shown.get()}) {
            EXPECT_FALSE(none->draws.effects.has(light) || none->draws.effects.has(environment));
            EXPECT_TRUE(none->draws.lights.empty());
            EXPECT_EQ(none->draws.environment, nullptr);
            EXPECT_EQ(none->counters.passes + 1, with->counters.passes);
        }
        EXPECT_TRUE(with->draws.effects.has(light) && with->draws.effects.has(environment));
        EXPECT_EQ(with->draws.lights.size(), 1u);
        EXPECT_TRUE(with->image.rgba != without->image.rgba);
    }
    EXPECT_EQ(backend_->resources().effectBytes, 0u) << "rows are lit in cache";
}

TEST_F(Effects, WhatAPredicateRefusesWouldChangeNothing) {
    FrameSettings settings;
    settings.draw.unlitTriangles = true;
    settings.wantDepthAndNormal = true;
    const auto state = drawn(building(), settings);
    ASSERT_FALSE(state->draws.effects.has(placeOf("light")));
    EXPECT_EQ(effectNamed("light")->toleranceSteps, 0);
    RenderRequest request;
    request.draws = &state->draws;
    request.mode = settings.mode;
    request.wantDepthAndNormal = true;
    EffectSet forced = state->draws.effects;
    forced.add(placeOf("light"));
    request.passes = passesOf(settings.mode, contentOf(state->draws), forced);
    ASSERT_EQ(std::count(request.passes.begin(), request.passes.end(), Pass::light), 1);
    Image image;
    ASSERT_TRUE(backend_->render(request, image));
    EXPECT_TRUE(image.rgba == state->image.rgba);
    EXPECT_TRUE(image.linear == state->image.linear);
}

TEST_F(Effects, ThatAreAskedForByNameAreThoseOfTheTable) {
    EXPECT_EQ(effectNamed("winds"), nullptr);
    for (size_t e = 0; e < effects().size(); ++e) {
        EXPECT_EQ(effectNamed(effects()[e]->name), effects()[e]);
        DrawSettings settings;
        settings.effects = {effects()[e]->name};
        EffectSet none;
        EXPECT_EQ(requestedEffects(none, settings), none) << "what the scene cannot show is not requested of it";
        if (effects()[e]->isRequested == nullptr) {
            EXPECT_TRUE(requestedEffects(allEffects(), settings).has(e));
            EXPECT_FALSE(requestedEffects(allEffects(), {}).has(e));
        }
    }
}

/// Lengths of a scene that is drawn in another unit, each once.
TEST(LengthUnits, ScaleWhatEffectsAreAskedForOnce) {
    DrawSettings of;
    of.parameters.occlusion.radius = 2;
    of.parameters.reflection.distance = 3;
    of.parameters.facts.extent = 5;
    of.parameters.fog.density = 7;
    of.parameters.fog.height = 11;
    of.parameters.fog.base = 13;
    const EffectParameters in = inUnits(of, 4).parameters;
    EXPECT_EQ(in.occlusion.radius, 8);
    EXPECT_EQ(in.reflection.distance, 12);
    EXPECT_EQ(in.facts.extent, 20);
    EXPECT_EQ(in.fog.density, 1.75);
    EXPECT_EQ(in.fog.height, 44);
    EXPECT_EQ(in.fog.base, 52);
}

}  // namespace
}  // namespace stipple::render
