// What an effect costs where nothing calls for it: no pass, no pipeline, no byte, the same picture bit by bit. Over the
// whole table of effects: a new one is taken in by itself (support/effect_scenes.h says how it is shown).
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/render/effect_status.h"
#include "engine/render/frame_passes.h"
#include "engine/render/wind.h"
#include "tests/support/backends_here.h"
#include "tests/support/effect_scenes.h"

namespace stipple::render {
namespace {

using test::listedEffects;

class ZeroCost : public test::BackendsHere {
  protected:
    void SetUp() override {
        BackendsHere::SetUp();
        placed_ = test::effectStores(folder_.path(), *executor_);
    }
    /// Everything keeps its colours, and nothing moves.
    static FrameSettings plain() {
        FrameSettings s;
        s.draw.worldUp = {0, 1, 0};
        s.draw.unlitTriangles = true;
        s.budgets.errorPixels = 2;
        return s;
    }
    /// A scene on a backend of its own, so that what is held is the scene's.
    std::unique_ptr<FrameState> open() {
        auto state = makeFrameState(placed_, usual(), *executor_, {});
        return state;
    }
    void draw(FrameState& state, const FrameSettings& settings, bool away = false) {
        setSway(settings.draw.wind, state.hierarchies, state.instances, {});
        const auto done = renderUntilComplete(state, test::effectView(96, 72, away), settings);
        ASSERT_TRUE(done) << done.error().line();
        status_ = effectStatus(state, settings.draw);
    }
    /// Frames until what nobody has needed for long is given back (two may be in flight).
    void rest(FrameState& state, const FrameSettings& settings) {
        for (uint32_t f = 0; f < 2 * kEffectHold + 2; ++f)
            ASSERT_TRUE(renderResident(state, test::effectView(96, 72), settings));
        status_ = effectStatus(state, settings.draw);
    }
    void expectNothing(size_t e, const char* when) const {
        const EffectStatus& s = status_.at(e);
        EXPECT_FALSE(s.isActive) << s.name << ", " << when;
        EXPECT_EQ(s.passes, 0u) << s.name << ", " << when;
        EXPECT_EQ(s.held.pipelines, 0u) << s.name << ", " << when;
        EXPECT_EQ(s.held.bytes, 0u) << s.name << ", " << when;
    }

    std::vector<PlacedStore> placed_;
    std::vector<EffectStatus> status_;
};

TEST_F(ZeroCost, NothingIsThereOfWhatNobodyAsksFor) {
    auto state = open();
    draw(*state, plain());
    EXPECT_EQ(state->draws.tables.size(), 0u);
    for (const size_t e : listedEffects()) expectNothing(e, "nobody asks");
    EXPECT_EQ(usual().resources().effectBytes, 0u);
}

TEST_F(ZeroCost, WhatIsAskedForInVainIsNotThereAndThePictureIsTheSame) {
    size_t known = 0;
    for (const size_t e : listedEffects()) {
        FrameSettings asked = plain();
        if (!test::addUselessly(effects()[e]->name, *executor_, asked.draw)) continue;
        ++known;
        FrameSettings without = asked;
        without.draw.effects.clear();
        without.draw.backdrop.reset();
        if (std::string("light") == effects()[e]->name) without.draw.unlitTriangles = true;
        auto state = open();
        draw(*state, plain());
        if (usual().resources().effectBytes > 0) rest(*state, plain());  // of the one before
        draw(*state, without);
        const Image before = state->image;
        draw(*state, asked);
        expectNothing(e, "in vain");
        EXPECT_TRUE(state->image.rgba == before.rgba) << effects()[e]->name;
    }
    EXPECT_GE(known, 4u);
}

TEST_F(ZeroCost, EachShowsWhereItIsCalledFor) {
    auto state = open();
    draw(*state, plain());
    const Image before = state->image;
    for (const size_t e : listedEffects()) {
        FrameSettings with = plain();
        test::addEffect(effects()[e]->name, *executor_, with.draw);
        draw(*state, with);
        const EffectStatus& s = status_.at(e);
        EXPECT_TRUE(s.isRequested && s.isActive)
            << s.name << ": tests/support/effect_scenes has to say how it is shown";
        EXPECT_FALSE(s.calledForBy.empty()) << s.name;
        EXPECT_EQ(s.passes, effects()[e]->passes.size()) << s.name;
        EXPECT_FALSE(state->image.rgba == before.rgba) << s.name;
    }
}

TEST_F(ZeroCost, AHundredTogglesReturnToTheByte) {
    // On the gpu a hundred of each in ./test --full alone: validation takes 0.3 s a frame.
    const int toggles = backends_.contains("gpu") && !test::isThorough() ? 6 : 100;
    auto state = open();
    draw(*state, plain());
    const BackendResources before = usual().resources();
    const Image picture = state->image;
    for (const size_t e : listedEffects()) {
        FrameSettings with = plain();
        test::addEffect(effects()[e]->name, *executor_, with.draw);
        for (int i = 0; i < toggles; ++i) draw(*state, i % 2 == 0 ? with : plain());
        EXPECT_TRUE(state->image.rgba == picture.rgba) << effects()[e]->name << ": the last is off";
        rest(*state, plain());
        expectNothing(e, "after the toggles");
        const BackendResources after = usual().resources();
        EXPECT_EQ(after.effects, before.effects) << effects()[e]->name;
        EXPECT_EQ(after.effectBytes, before.effectBytes) << effects()[e]->name;
    }
}

TEST_F(ZeroCost, ComesInTheFrameInWhichItsTriggerDoesAndGoesAfterIt) {
    for (const size_t e : listedEffects()) {
        if (test::isOfNothing(effects()[e]->name)) continue;
        FrameSettings with = plain();
        test::addEffect(effects()[e]->name, *executor_, with.draw);
        auto state = open();
        draw(*state, with, true);
        expectNothing(e, "nothing is in view");
        draw(*state, with);
        EXPECT_TRUE(status_.at(e).isActive) << status_.at(e).name << ": in the first frame that shows it";
        draw(*state, with, true);
        EXPECT_FALSE(status_.at(e).isActive) << status_.at(e).name;
        EXPECT_EQ(status_.at(e).passes, 0u) << status_.at(e).name;
        rest(*state, plain());
        expectNothing(e, "some frames later");
    }
}

TEST_F(ZeroCost, ThoseOfSeveralAreThoseOfEachTogether) {
    const std::vector<size_t> listed = listedEffects();
    std::vector<EffectStatus> alone(effects().size());
    auto state = open();
    const auto drawSet = [&](uint32_t bits) {
        FrameSettings with = plain();
        for (size_t i = 0; i < listed.size(); ++i)
            if ((bits >> i & 1u) != 0) test::addEffect(effects()[listed[i]]->name, *executor_, with.draw);
        draw(*state, with);
    };
    for (size_t i = 0; i < listed.size(); ++i) {
        drawSet(1u << i);
        alone.at(listed[i]) = status_.at(listed[i]);
    }
    // Every two effects meet in all four ways, in as many rows each (an orthogonal array of strength two): whether row
    // r has effect i is the parity of r AND (i + 1).
    uint32_t rows = 1;
    while (rows <= listed.size()) rows *= 2;
    for (uint32_t row = 0; row < rows; ++row) {
        uint32_t bits = 0;
        for (uint32_t i = 0; i < listed.size(); ++i)
            bits |= static_cast<uint32_t>(std::popcount(row & (i + 1)) % 2) << i;
        drawSet(bits);
        for (size_t i = 0; i < listed.size(); ++i) {
            const EffectStatus &s = status_.at(listed[i]), &one = alone.at(listed[i]);
            const bool isIn = (bits >> i & 1u) != 0;
            if (s.name == "light") continue;  // that of the environment's is a request for it, too
            EXPECT_EQ(s.isActive, isIn) << s.name << " in row " << row;
            EXPECT_EQ(s.passes, isIn ? one.passes : 0) << s.name << " in row " << row;
            if (isIn) EXPECT_GE(s.held.bytes, one.held.bytes) << s.name;
        }
    }
}

TEST_F(ZeroCost, WhatAPredicateRefusesWouldChangeLittle) {
    for (const size_t e : listedEffects()) {
        const Effect& effect = *effects()[e];
        FrameSettings asked = plain();
        if (effect.passes.empty() || effect.isRequested != nullptr ||
            !test::addUselessly(effect.name, *executor_, asked.draw))
            continue;
        auto state = open();
        draw(*state, asked);
        const Image without = state->image;
        ASSERT_FALSE(status_.at(e).isActive) << effect.name;
        // On all the same.
        DrawList& draws = state->draws;
        const lod::View& v = draws.view;
        draws.effects.add(e);
        if (effect.fill != nullptr)
            effect.fill(asked.draw, glm::transpose(glm::dmat3(v.right, v.down, v.forward)), draws);
        RenderRequest request;
        request.draws = &draws;
        request.mode = asked.mode;
        request.passes = passesOf(asked.mode, contentOf(draws), draws.effects);
        Image forced;
        ASSERT_TRUE(usual().render(request, forced));
        ASSERT_EQ(forced.rgba.size(), without.rgba.size());
        int most = 0;
        for (size_t i = 0; i < forced.rgba.size(); ++i)
            for (uint32_t shift = 0; shift < 24; shift += 8)
                most = std::max(most, std::abs(static_cast<int>(forced.rgba[i] >> shift & 255u) -
                                               static_cast<int>(without.rgba[i] >> shift & 255u)));
        EXPECT_LE(most, effect.toleranceSteps) << effect.name;
    }
}

}  // namespace
}  // namespace stipple::render
