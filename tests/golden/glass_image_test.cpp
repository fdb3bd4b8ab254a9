// Glass: every backend shows what the fp64 restatement shows, in all three ways, of triangles, points, curves and
// patches; where there is none nothing of it is there, and what lies beside it keeps its bytes.
#include <gtest/gtest.h>

#include <functional>

#include "engine/reference/reference.h"
#include "engine/render/layered_frame.h"
#include "lod/store/materials.h"
#include "tests/support/backends_here.h"
#include "tests/support/curves.h"
#include "tests/support/glass.h"

namespace stipple {
namespace {

class Glass : public test::BackendsHere {
  protected:
    void SetUp() override {
        test::BackendsHere::SetUp();
        lod::Optics o = *lod::opticsNamed("glass");
        o.attenuationDistance = 1.5f;
        o.attenuationColour = {0.6f, 0.9f, 0.7f};
        clear_ = test::meshStore(test::ball(160), test::glassMaterial(o), folder_ / "clear.stipple", *executor_);
        rough_ = test::meshStore(test::ball(160), test::glassMaterial(o, 0.3f), folder_ / "rough.stipple", *executor_);
        scene::Material paint;
        paint.metallic = 0;
        paint.roughness = 0.9f;
        board_ = test::meshStore(test::board(-2.5), paint, folder_ / "board.stipple", *executor_);
        test::writePly(folder_ / "a.ply", test::spherePoints(30'000, 0xe0f0e8));
        points_ = test::buildAndOpen(folder_ / "a.ply", folder_ / "points.stipple", *executor_);
        patches_ = test::patchStore(test::ball(140), 10'000, folder_ / "patches.stipple", *executor_);
    }
    std::vector<render::PlacedStore> scene(const std::shared_ptr<const lod::Store>& body) const {
        return {{board_, {}, {}}, {body, {}, {}}};
    }
    render::Image draw(const std::vector<render::PlacedStore>& placed, render::Backend& backend, const lod::View& view,
                       const render::FrameSettings& settings) {
        return test::draw(placed, backend, *executor_, view, settings);
    }
    std::shared_ptr<const lod::Store> clear_, rough_, board_, points_, patches_;
};

/// Share of pixels whose bytes differ by more than three of 255.
double differing(const render::Image& a, const render::Image& b) {
    size_t count = 0;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        bool differs = false;
        for (uint32_t s = 0; s < 24; s += 8)
            differs = differs ||
                      std::abs(static_cast<int>(a.rgba[i] >> s & 255) - static_cast<int>(b.rgba[i] >> s & 255)) > 3;
        count += differs ? 1 : 0;
    }
    return static_cast<double>(count) / static_cast<double>(a.rgba.size());
}

TEST_F(Glass, IsThatOfTheOracleInAllWays) {
    const auto oracle = reference::makeReferenceBackend(*executor_);
    backends_.erase("fp64");
    const auto environment = std::make_shared<const render::Environment>(
        render::makeEnvironment(test::directionLight(256), 0.5f, *executor_, true));
    struct Look {
        std::shared_ptr<const lod::Store> body;
        render::Mode mode;
        bool isOrthographic, hasEnvironment, hasLamp;
    };
    render::WorldLight lamp;
    lamp.position = {2, 2, 2};
    lamp.colour = glm::vec3(6);
    for (const Look& look : {Look{clear_, render::Mode::pullpush, false, true, false},
                             {clear_, render::Mode::pullpush, true, false, true},
                             {rough_, render::Mode::pullpush, false, false, false},
                             {points_, render::Mode::pullpush, false, true, false},
                             {points_, render::Mode::ewa, true, true, true},
                             {patches_, render::Mode::pullpush, false, true, true},
                             {patches_, render::Mode::ewa, true, false, true}})
        for (const uint32_t way : {shared::kRefractEnvironment, shared::kRefractScreen, shared::kRefractObject}) {
            render::FrameSettings settings = test::glassSettings(look.mode);
            settings.draw.refract = way;
            if (look.hasEnvironment) settings.draw.environment = environment;
            if (look.hasLamp) settings.draw.lights = {lamp};
            if (look.body == points_ || look.body == patches_) {
                settings.draw.pointMaterial = lod::packed(*lod::materialNamed("glass"));
                settings.draw.optics = lod::opticsNamed("glass");
            }
            const lod::View view = test::glassView({0.9, 0.7, 3.6}, 240, look.isOrthographic);
            const render::Image truth = draw(scene(look.body), *oracle, view, settings);
            render::FrameSettings other = settings;
            other.draw.refract = (way + 1) % 3;
            const render::Image control = draw(scene(look.body), *oracle, view, other);
            for (auto& [name, backend] : backends_) {
                SCOPED_TRACE(testing::Message()
                             << name << ", way " << way << ", mode " << render::reconstructionOf(look.mode).name
                             << look.isOrthographic << look.hasEnvironment << look.hasLamp);
                const render::Image image = draw(scene(look.body), *backend, view, settings);
                const double db = test::drawnPsnr(image, truth), share = differing(image, truth);
                std::printf("%-8s way %u: %.1f dB, %.3f %% differ (another way: %.1f dB)\n", name.c_str(), way, db,
                            100 * share, test::drawnPsnr(control, truth));
                EXPECT_GE(db, 50);
                EXPECT_LE(share, 0.001);
                EXPECT_LE(test::drawnPsnr(control, truth), 40) << "the control";
            }
        }
}

TEST_F(Glass, LeavesWhatIsBesideItAlone) {
    for (const auto& [body, isPoints] : {std::pair{clear_, false}, {points_, true}}) {
        render::FrameSettings settings = test::glassSettings(render::Mode::pullpush);
        const lod::View view = test::glassView({0.9, 0.7, 3.6}, 200);
        if (isPoints) {
            settings.draw.pointMaterial = lod::packed(*lod::materialNamed("glass"));
            settings.draw.optics = lod::opticsNamed("glass");
        }
        const render::Image with = draw(scene(body), usual(), view, settings),
                            without = draw({{board_, {}, {}}}, usual(), view, settings),
                            alone = draw({{body, {}, {}}}, usual(), view, settings);
        size_t beside = 0, seen = 0;
        for (size_t i = 0; i < with.rgba.size(); ++i) {
            if (alone.depth[i] > 0) {
                seen += with.rgba[i] != alone.rgba[i];
                EXPECT_EQ(with.depth[i], alone.depth[i]);
                continue;
            }
            ++beside;
            ASSERT_EQ(with.rgba[i], without.rgba[i]);
            ASSERT_EQ(with.depth[i], without.depth[i]);
        }
        EXPECT_GT(beside, 10'000u);
        EXPECT_GT(seen, 3'000u) << "through it the board is seen";
    }
}

TEST_F(Glass, BehindSomethingIsNotSeen) {
    scene::Material paint;
    const auto front = test::meshStore(test::board(1.5), paint, folder_ / "front.stipple", *executor_);
    const render::FrameSettings settings = test::glassSettings(render::Mode::pullpush);
    const lod::View view = test::glassView({0.9, 0.7, 3.6}, 200);
    const render::Image with = draw({{front, {}, {}}, {clear_, {}, {}}}, usual(), view, settings),
                        without = draw({{front, {}, {}}}, usual(), view, settings);
    size_t covered = 0;
    for (size_t i = 0; i < with.rgba.size(); ++i)
        if (without.depth[i] > 0) {
            ++covered;
            ASSERT_EQ(with.rgba[i], without.rgba[i]);
        }
    EXPECT_GT(covered, 20'000u);
}

TEST_F(Glass, OfItThereIsNothingWhereThereIsNone) {
    render::FrameSettings settings = test::glassSettings(render::Mode::pullpush);
    const lod::View view = test::glassView({0.9, 0.7, 3.6}, 200);
    const auto drawn = [&](const std::vector<render::PlacedStore>& placed, const render::FrameSettings& s) {
        auto state = render::makeFrameState(placed, usual(), *executor_, {});
        EXPECT_TRUE(render::renderUntilComplete(*state, view, s));
        return state;
    };
    const auto none = drawn({{board_, {}, {}}}, settings);
    settings.draw.refract = shared::kRefractScreen;
    const auto asked = drawn({{board_, {}, {}}}, settings);
    EXPECT_TRUE(none->image.rgba == asked->image.rgba);
    const uint64_t effectBytes = usual().resources().effectBytes;
    for (const auto* state : {none.get(), asked.get()}) {
        EXPECT_EQ(state->layered, nullptr);
        EXPECT_EQ(state->draws.glass, nullptr);
        EXPECT_EQ(state->counters.passes, none->counters.passes);
    }
    // Glass beside the picture is no layer of the frame.
    lod::Instance aside;
    aside.translation = {500, 0, 0};
    const auto beside = drawn({{board_, {}, {}}, {clear_, aside, {}}}, settings);
    EXPECT_EQ(beside->draws.glass, nullptr);
    EXPECT_EQ(beside->counters.passes, none->counters.passes);
    EXPECT_TRUE(beside->image.rgba == none->image.rgba);
    EXPECT_EQ(usual().resources().effectBytes, effectBytes);
    const auto some = drawn({{board_, {}, {}}, {clear_, {}, {}}}, settings);
    EXPECT_GT(some->counters.passes, none->counters.passes);
    EXPECT_NE(some->draws.glass, nullptr);
    // Unlit it is drawn as anything else.
    settings.draw.unlitTriangles = true;
    EXPECT_EQ(drawn({{board_, {}, {}}, {clear_, {}, {}}}, settings)->draws.glass, nullptr);
}

TEST_F(Glass, IsTheSameForAnyNumberOfThreadsAndOrder) {
    render::FrameSettings settings = test::glassSettings(render::Mode::pullpush);
    const lod::View view = test::glassView({0.9, 0.7, 3.6}, 200);
    lod::Instance behind;
    behind.translation = {-0.6, -0.3, -1.2};
    behind.scale = 0.6;
    const auto picture = [&](int threads, bool isTurned) {
        const auto executor = makeTbbExecutor(threads);
        const auto backend = cpu::makeCpuBackend(*executor);
        std::vector<render::PlacedStore> placed{{board_, {}, {}}, {clear_, {}, {}}, {clear_, behind, {}}};
        if (isTurned) std::swap(placed[1], placed[2]);
        return test::draw(placed, *backend, *executor, view, settings).rgba;
    };
    const auto one = picture(1, false);
    EXPECT_TRUE(picture(4, false) == one);
    EXPECT_TRUE(picture(2, true) == one) << "the farther is drawn first";
}

}  // namespace
}  // namespace stipple
