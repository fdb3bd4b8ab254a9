// Shadows: every backend shows what the fp64 restatement shows; maps that hold are kept; what cannot be meant costs
// nothing but a picture without it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/reference/reference.h"
#include "engine/render/effects/effect.h"
#include "engine/render/shadow_frame.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/shadow_scene.h"

namespace stipple {
namespace {

using namespace test::shadows;
using glm::dvec3;
using ShadowPictures = test::BackendsHere;

#ifndef STIPPLE_ON_GPU
TEST_F(ShadowPictures, FallInScenesOfAnySize) {
    const auto shown = [&](double size) {
        std::vector<test::TestPoint> points = floorAndBall();
        for (test::TestPoint& p : points) {
            p.position *= size;
            p.radius *= static_cast<float>(size);
        }
        test::writePly(folder_ / "a.ply", points, true, true);
        const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
        lod::View view = viewOf();
        view.eye *= size;
        view.nearPlane *= size;
        render::WorldLight lamp = spot();
        lamp.position *= size;
        lamp.colour *= static_cast<float>(size * size);
        lamp.size = static_cast<float>(0.2 * size);
        render::FrameSettings settings = under(sun(0.1f));
        settings.draw.lights.push_back(lamp);
        return std::move(drawn(store, usual(), *executor_, view, settings)->image);
    };
    const render::Image usualSize = shown(1);
    for (const double size : {0x1p-30, 0x1p+50}) EXPECT_GE(test::drawnPsnr(shown(size), usualSize), 50) << size;
}
#endif

/// Pixels that show another surface than the truth does, at silhouettes, are made its own. Returns their share.
double takeOtherSurfaces(render::Image& shown, const render::Image& truth) {
    size_t count = 0;
    for (size_t i = 0; i < truth.depth.size(); ++i) {
        if (std::abs(shown.depth[i] - truth.depth[i]) <= 0.01f * truth.depth[i]) continue;
        ++count;
        shown.rgba[i] = truth.rgba[i];
        for (size_t c = 3 * i; c < 3 * i + 3; ++c) shown.linear[c] = truth.linear[c];
    }
    return double(count) / double(truth.depth.size());
}

TEST_F(ShadowPictures, ShowWhatTheOracleShows) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto cloud = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_),
               mesh = triangles(folder_ / "b.stipple", *executor_),
               curves =
                   test::buildCurves(test::curls({.count = 60, .radius = 0.05f}), folder_ / "c.stipple", *executor_);
    const auto oracle = reference::makeReferenceBackend(*executor_);
    backends_.erase("fp64");
    struct Look {
        std::shared_ptr<const lod::Store> store;
        render::WorldLight light;
        render::Mode mode;
        bool isOrthographic;
    };
    using enum render::Mode;
    std::vector<Look> looks{{mesh, sun(), splat, false},
                            {mesh, sun(0.2f), splat, true},
                            {cloud, sun(0.5f), surface, false},
                            {curves, sun(), splat, false},
                            {cloud, spot(), splat, true}};
    for (const render::Mode mode : {surface, pullpush, splat, ewa, pullpushExact, points})
        looks.push_back({cloud, mode == splat ? sun(0.2f) : sun(), mode, mode == pullpush});
    for (const Look& look : looks) {
        const lod::View view = viewOf(look.isOrthographic);
        const render::FrameSettings settings = under(look.light, look.mode);
        render::FrameSettings open = settings;
        open.draw.lights[0].castsShadow = false;
        const auto truth = drawn(look.store, *oracle, *executor_, view, settings),
                   control = drawn(look.store, *oracle, *executor_, view, open);
        for (auto& [name, backend] : backends_) {
            SCOPED_TRACE(testing::Message() << name << ", " << render::reconstructionOf(look.mode).name
                                            << (look.isOrthographic ? ", orthographic" : ""));
            const auto shown = drawn(look.store, *backend, *executor_, view, settings);
            // (Of reconstruction, whose tests count them.)
            EXPECT_LE(takeOtherSurfaces(shown->image, truth->image), 0.001);
            const double db = test::drawnPsnr(shown->image, truth->image);
            std::printf("%-8s %-14s %5.1f dB (without: %.1f)\n", name.c_str(), render::reconstructionOf(look.mode).name,
                        db, test::drawnPsnr(control->image, truth->image));
            EXPECT_GE(db, 50);
            const auto d = reference::compareImages(shown->image, truth->image, 4, nullptr);
            ASSERT_TRUE(d);
            EXPECT_LE(d->differingFraction, 0.001);
            EXPECT_LE(test::drawnPsnr(control->image, truth->image), 35) << "the control";
        }
    }
}

TEST_F(ShadowPictures, MapsThatHoldAreKept) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    const render::FrameSettings settings = under(sun());
    const auto state = drawn(store, usual(), *executor_, viewOf(), settings);
    EXPECT_GT(state->counters.shadowMaps, 0u);
    EXPECT_EQ(state->counters.shadowMapsDrawn, state->counters.shadowMaps);
    const auto texelsOf = [](const render::FrameState& of) {
        std::vector<std::shared_ptr<const render::ShadowTexels>> texels;
        for (const auto& map : of.draws.shadowMaps->maps) texels.push_back(map.texels);
        return texels;
    };
    const auto first = texelsOf(*state);
    const render::Image image = state->image;
    // Both still; then the camera moves by less than a texel, and turns.
    ASSERT_TRUE(render::renderFrame(*state, viewOf(), settings));
    EXPECT_EQ(state->counters.shadowMapsDrawn, 0u);
    EXPECT_TRUE(state->image.rgba == image.rgba);
    lod::View moved = viewOf(false, dvec3(2.2, -3.2, 2.6) + dvec3(0.0004, 0.0003, -0.0002));
    ASSERT_TRUE(render::renderFrame(*state, moved, settings));
    EXPECT_EQ(state->counters.shadowMapsDrawn, 0u);
    EXPECT_TRUE(texelsOf(*state) == first) << "the same maps";
    // Whoever begins there has the same texels, bit by bit: shadows do not swim.
    const auto other = drawn(store, usual(), *executor_, moved, settings);
    const auto again = texelsOf(*other);
    ASSERT_EQ(again.size(), first.size());
    for (size_t m = 0; m < first.size(); ++m) EXPECT_TRUE(again[m]->depth == first[m]->depth) << "map " << m;
    EXPECT_TRUE(other->image.rgba == state->image.rgba) << "pictures do not remember what was drawn before";
    // The control: far away the maps are others.
    moved.eye += dvec3(3, 0, 0);
    ASSERT_TRUE(render::renderFrame(*state, moved, settings));
    EXPECT_GT(state->counters.shadowMapsDrawn, 0u);
}

#ifndef STIPPLE_ON_GPU
TEST_F(ShadowPictures, CostNothingWhereNothingCastsOrNothingIsLit) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    render::FrameSettings without = under(sun()), unasked = under(sun()), unlit = under(sun()), lamp = under(sun());
    without.draw.lights[0].castsShadow = false;
    unasked.draw.effects.clear();
    unlit.draw.lit = false;
    unlit.draw.unlitTriangles = true;
    lamp.draw.lights[0].kind = shared::kLightPoint;
    lamp.draw.lights[0].position = {0, 0, 5};
    const uint64_t before = usual().resources().effectBytes;
    const auto open = drawn(store, usual(), *executor_, viewOf(), without);
    for (const render::FrameSettings& settings : {without, unasked, unlit, lamp}) {
        const auto state = drawn(store, usual(), *executor_, viewOf(), settings);
        EXPECT_EQ(state->counters.shadowMaps, 0u);
        EXPECT_FALSE(state->shadows && !state->shadows->kept.empty());
        EXPECT_FALSE(state->draws.shadowMaps);
        EXPECT_EQ(usual().resources().effectBytes, before);
        EXPECT_LE(state->counters.passes, open->counters.passes);
    }
    // On and off again: the same picture and the same bytes.
    auto state = render::makeFrameState({store}, usual(), *executor_, {});
    for (int k = 0; k < 3; ++k) {
        ASSERT_TRUE(render::renderUntilComplete(*state, viewOf(), under(sun())));
        EXPECT_GT(usual().resources().effectBytes, before) << "the control";
        EXPECT_EQ(state->counters.passes, open->counters.passes + 1);
        ASSERT_TRUE(render::renderUntilComplete(*state, viewOf(), without));
        for (uint32_t f = 0; f < render::kEffectHold; ++f)
            ASSERT_TRUE(render::renderResident(*state, viewOf(), without));
        EXPECT_EQ(usual().resources().effectBytes, before);
        EXPECT_TRUE(state->image.rgba == open->image.rgba);
    }
}

TEST_F(ShadowPictures, SurviveLightsThatCannotBeMeant) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    const auto isFinite = [](const render::Image& image) {
        return std::all_of(image.linear.begin(), image.linear.end(), [](float v) { return std::isfinite(v); });
    };
    render::WorldLight nowhere = sun(), unreal = sun(), closed = spot(), inside = spot(), wide = spot();
    nowhere.direction = dvec3(0);
    unreal.direction = dvec3(std::nan(""), 0, 1);
    closed.outerCone = 0;
    inside.position = kBall + dvec3(0, 0, -0.45);
    wide.outerCone = 1.5707f;
    for (const render::WorldLight& light : {nowhere, closed}) {
        const auto state = drawn(store, usual(), *executor_, viewOf(), under(light));
        EXPECT_EQ(state->counters.shadowLightsLeft, 1u);
        EXPECT_EQ(state->counters.shadowMaps, 0u);
        EXPECT_TRUE(isFinite(state->image));
    }
    EXPECT_EQ(drawn(store, usual(), *executor_, viewOf(), under(unreal))->counters.shadowLightsLeft, 1u);
    for (const render::WorldLight& light : {inside, wide}) {
        const auto state = drawn(store, usual(), *executor_, viewOf(), under(light));
        EXPECT_EQ(state->counters.shadowLightsLeft, 0u);
        EXPECT_TRUE(isFinite(state->image));
    }
    render::FrameSettings crowd = under(spot());
    crowd.draw.lights.assign(10'000, spot());
    for (render::WorldLight& light : crowd.draw.lights) light.colour *= 1e-4f;
    lod::View small = viewOf();
    small.width = small.height = 16;
    const auto state = drawn(store, usual(), *executor_, small, crowd);
    EXPECT_EQ(state->counters.shadowMaps, uint64_t{shared::kMostShadowLights});
    EXPECT_EQ(state->counters.shadowLightsLeft, 10'000 - uint64_t{shared::kMostShadowLights});
    EXPECT_TRUE(isFinite(state->image));
}

TEST_F(ShadowPictures, MapsAreDrawnAsDepthsAlone) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    const auto state = drawn(store, usual(), *executor_, viewOf(), under(sun()));
    const auto expectDepthsAlone = [&] {
        const render::Image& map = state->shadows->image;
        const size_t texels = size_t{map.width} * map.height;
        ASSERT_GT(texels, 0u);
        EXPECT_EQ(map.depth.size(), texels);
        EXPECT_EQ(map.rgba.size(), texels);
        EXPECT_TRUE(map.normal.empty());
        EXPECT_TRUE(map.linear.empty());
        const auto isNothing = [](float depth) { return depth == 0; };
        const auto nothing = std::count_if(map.depth.begin(), map.depth.end(), isNothing);
        EXPECT_GT(nothing, 0) << "beside the scene";
        EXPECT_LT(nothing, static_cast<std::ptrdiff_t>(texels));
    };
    expectDepthsAlone();
    // Into an image that was another's.
    state->shadows->image.normal.assign(7, 1.0f);
    state->shadows->image.linear.assign(7, 1.0f);
    state->shadows->kept.clear();
    ASSERT_TRUE(render::renderUntilComplete(*state, viewOf(), under(sun())));
    expectDepthsAlone();
}

TEST_F(ShadowPictures, BecomeCoarserFirstWhereTheBudgetIsSmall) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    const auto store = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    render::FrameSettings settings = under(sun());
    const auto whole = drawn(store, usual(), *executor_, viewOf(), settings);
    const auto errorOf = [](const render::FrameState& state) {
        double most = 0;
        for (const auto& map : state.draws.shadowMaps->maps) most = std::max(most, map.casterError);
        return most;
    };
    settings.budgets.records = whole->counters.recordsDrawn + 24'000;
    const auto tight = drawn(store, usual(), *executor_, viewOf(), settings);
    EXPECT_EQ(tight->counters.recordsDrawn, whole->counters.recordsDrawn) << "what is seen comes first";
    EXPECT_GT(errorOf(*tight), errorOf(*whole));
    EXPECT_GT(tight->counters.shadowMaps, 0u);
    settings.budgets.records = 500;
    const auto least = drawn(store, usual(), *executor_, viewOf(), settings);
    EXPECT_GT(least->counters.recordsDrawn, 0u) << "still a picture";
}

TEST_F(ShadowPictures, PenumbrasWidenWithTheDistanceOfWhatCasts) {
    test::writePly(folder_ / "a.ply", floorAndBall(), true, true);
    test::writePly(folder_ / "b.ply", floorAndBall(true, 0.35), true, true);
    const auto high = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_),
               low = test::buildAndOpen(folder_ / "b.ply", folder_ / "b.stipple", *executor_);
    // Pixels of the floor that the light comes to in part.
    const auto partly = [&](const std::shared_ptr<const lod::Store>& store, float size) {
        const Mask mask = maskOf(store, usual(), *executor_, viewOf(), under(sun(size)));
        size_t count = 0;
        for (size_t i = 0; i < mask.share.size(); ++i) {
            const float depth = mask.state->image.depth[i];
            if (!(depth > 0) || std::abs(placeOf(viewOf(), i, double{depth}).z) > 1e-3) continue;
            count += mask.share[i] > 0.1 && mask.share[i] < 0.9 ? 1 : 0;
        }
        return count;
    };
    const size_t hard = partly(high, 0), small = partly(high, 0.1f), large = partly(high, 0.3f),
                 near = partly(low, 0.3f);
    std::printf("pixels in penumbra: %zu, %zu, %zu; %zu of what is near\n", hard, small, large, near);
    EXPECT_GT(small, 2 * hard);
    EXPECT_GT(large, 2 * small);
    EXPECT_LT(near, large - large / 8) << "nearer what casts they are narrower";
}
#endif

TEST_F(ShadowPictures, LeavesLetLightOfTheirColourThrough) {
    // A ribbon, green, over the floor.
    test::writePly(folder_ / "a.ply", floorAndBall(false), true, true);
    const auto floor = test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_);
    lod::CurveSet leaf;
    leaf.hasColour = true;
    for (const double x : {-1.0, 0.0, 1.0}) leaf.addVertex({x, 0, 0.5}, 0.3f, {0, 0, 1}, 0x00c000);
    leaf.endCurve(true);
    const auto store = test::buildCurves(lod::cleanCurves(std::move(leaf), 0), folder_ / "b.stipple", *executor_);
    const lod::View view = viewOf();
    const auto draw = [&](bool casts) {
        render::FrameSettings settings = under(sun());
        settings.draw.lights[0].castsShadow = casts;
        auto state = render::makeFrameState({floor, store}, usual(), *executor_, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
        return state;
    };
    const auto with = draw(true), without = draw(false);
    // The middle of the ribbon's shadow.
    const dvec3 at = -dvec3(kTowardsSun.x, kTowardsSun.y, 0) * (0.5 / kTowardsSun.z), d = at - view.eye;
    const double z = glm::dot(d, view.forward);
    const auto px = static_cast<size_t>(glm::dot(d, view.right) / z * view.focalPixels + 0.5 * view.width),
               py = static_cast<size_t>(glm::dot(d, view.down) / z * view.focalPixels + 0.5 * view.height),
               i = py * view.width + px;
    const auto change = [&](size_t c) {
        return double{with->image.linear[3 * i + c]} / double{without->image.linear[3 * i + c]};
    };
    std::printf("red %.3f, green %.3f, blue %.3f of the light\n", change(0), change(1), change(2));
    EXPECT_LT(change(0), 0.5);
    EXPECT_GT(change(1), change(0) + 0.15) << "green light comes through";
    EXPECT_LT(change(1), 0.9);
}

}  // namespace
}  // namespace stipple