// Under a budget points that are hidden are not refined (engine/render/unrefined.h), and what is seen is finer for it:
// the picture is bit for bit that of its finer error with everything refined, whatever was drawn before.
#include "engine/render/unrefined.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/scene/camera.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using render::Mode;

/// A wall, and balls behind it.
class Unrefined : public testing::Test {
  protected:
    static constexpr double kEdge = 6.0 / 400;  // of the wall's points
    static constexpr uint64_t kRecords = 250'000;

    void SetUp() override {
        std::vector<test::TestPoint> wall;
        for (int y = -160; y <= 160; ++y)
            for (int x = -200; x <= 200; ++x)
                wall.push_back(
                    {glm::dvec3(x * kEdge, y * kEdge, 0), {0, 0, 1}, 0x4060a0, static_cast<float>(1.5 * kEdge)});
        test::writePly(folder_ / "wall.ply", wall, true, true);
        test::writePly(folder_ / "ball.ply", test::bumpySphere(40'000, 3));
        const auto wallStore = test::buildAndOpen(folder_ / "wall.ply", folder_ / "wall.stipple", *executor_, 1024);
        const auto ball = test::buildAndOpen(folder_ / "ball.ply", folder_ / "ball.stipple", *executor_, 512);
        placed_.push_back({wallStore, {}, {}});
        for (int k = 0; k < 40; ++k) {
            lod::Instance place;
            place.scale = 0.3;
            place.translation = {0.8 * (k % 5 - 2.0), 0.8 * (k / 5 % 4 - 1.5), k < 20 ? -1.5 : -2.5};
            placed_.push_back({ball, place, {}});
        }
    }
    static lod::View look(const glm::dvec3& eye, const glm::dvec3& target, bool isOrthographic = false) {
        scene::Camera camera;
        camera.eye = eye;
        camera.target = target;
        camera.orthoWidth = isOrthographic ? 2.2 : 0;
        return scene::makeView(camera, 208, 150, 0.01);
    }
    static render::FrameSettings settingsOf(Mode mode, bool leaves, uint64_t records = kRecords, double tau = 0.05) {
        render::FrameSettings settings = test::drawnAs(mode, tau);
        settings.budgets.records = records;
        settings.leavesHiddenCoarse = leaves;
        return settings;
    }

    const test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::vector<render::PlacedStore> placed_;
};

struct Drawing {
    Drawing(const std::vector<render::PlacedStore>& placed, Executor& executor)
        : backend(cpu::makeCpuBackend(executor)), state(render::makeFrameState(placed, *backend, executor, {})) {}
    void draw(const lod::View& view, const render::FrameSettings& settings) {
        const auto complete = render::renderUntilComplete(*state, view, settings);
        ASSERT_TRUE(complete && *complete);
    }
    void frame(const lod::View& view, const render::FrameSettings& settings) {
        ASSERT_TRUE(render::renderFrame(*state, view, settings));
        state->streamer->wait();
    }
    const FrameCounters& counters() const { return state->counters; }
    std::unique_ptr<render::Backend> backend;
    std::unique_ptr<render::FrameState> state;
};

bool areSame(const render::Image& a, const render::Image& b) {
    return a.rgba == b.rgba && a.depth == b.depth && a.normal == b.normal && a.linear == b.linear;
}

/// Orthographic depths count from before all that is drawn, which is not the same: they are rounded in other places.
void expectSameToRounding(const render::Image& a, const render::Image& b, const std::string& what) {
    size_t beside = 0;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        int most = 0;
        for (int shift = 0; shift < 32; shift += 8)
            most = std::max(most, std::abs(static_cast<int>(a.rgba[i] >> shift & 255) -
                                           static_cast<int>(b.rgba[i] >> shift & 255)));
        beside += most > 1 || std::abs(a.depth[i] - b.depth[i]) > 1e-6f * b.depth[i] ? 1 : 0;
    }
    EXPECT_LE(beside, a.rgba.size() / 10'000) << what;
}

TEST_F(Unrefined, BuyAFinerErrorThatIsWhatItSays) {
    Rng rng(5);
    size_t finer = 0;
    for (const Mode mode : {Mode::splat, Mode::surface})
        for (const bool isOrthographic : {false, true})
            for (int round = 0; round < 10; ++round) {
                const glm::dvec3 eye(rng.uniform(-1.6, 1.6), rng.uniform(-1, 1), rng.uniform(0.6, 2.2));
                const lod::View view = look(eye, {rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), 0}, isOrthographic);
                Drawing leaving(placed_, *executor_), plain(placed_, *executor_);
                leaving.draw(view, settingsOf(mode, true));
                plain.draw(view, settingsOf(mode, false));
                const FrameCounters& c = leaving.counters();
                const double tau = c.tauTargetPixels, before = plain.counters().tauTargetPixels;
                const auto name = fmt::format(
                    "{} orthographic {} round {}: {:.3f} px, {:.3f} px with all refined, {} coarse",
                    render::reconstructionOf(mode).name, isOrthographic, round, tau, before, c.nodesLeftCoarse);
                EXPECT_LE(tau, before) << name;
                EXPECT_LE(c.recordsDrawn, kRecords) << name;
                EXPECT_EQ(c.nodesSeenCoarse, 0u) << name;
                EXPECT_EQ(plain.counters().nodesLeftCoarse, 0u) << name;
                finer += tau < 0.85 * before ? 1 : 0;
                // At that error with everything refined it is the same picture. (A step of tau is its 32nd octave.)
                const render::Image seen = leaving.state->image;
                plain.draw(view, settingsOf(mode, false, ~uint64_t{0}, tau * 1.001));
                if (c.nodesLeftCoarse > 0) EXPECT_GT(plain.counters().recordsDrawn, c.recordsDrawn + 1000) << name;
                if (isOrthographic)
                    expectSameToRounding(seen, plain.state->image, name);
                else
                    EXPECT_TRUE(areSame(seen, plain.state->image)) << name;
            }
    EXPECT_GE(finer, 30u) << "of 40: that is what it is for";
}

/// Large balls that stick out behind a small wall, by less than their coarse levels are off.
TEST_F(Unrefined, AreNoneThatWouldBeSeenIfTheyWereRefined) {
    std::vector<test::TestPoint> wall;
    for (int y = -50; y <= 50; ++y)
        for (int x = -50; x <= 50; ++x) wall.push_back({glm::dvec3(x, y, 0) * 0.02, {0, 0, 1}, 0x4060a0, 0.03f});
    test::writePly(folder_ / "small.ply", wall, true, true);
    test::writePly(folder_ / "large.ply", test::bumpySphere(150'000, 3));
    std::vector<render::PlacedStore> placed{
        {test::buildAndOpen(folder_ / "small.ply", folder_ / "small.stipple", *executor_, 1024), {}, {}}};
    const auto large = test::buildAndOpen(folder_ / "large.ply", folder_ / "large.stipple", *executor_, 256);
    for (int k = 0; k < 4; ++k) {
        lod::Instance place;
        place.scale = 1.0;
        place.translation = {k % 2 - 0.5, k / 2 - 0.5, -1.6};
        placed.push_back({large, place, {}});
    }
    Rng rng(11);
    size_t coarse = 0;
    for (int round = 0; round < 24; ++round) {
        scene::Camera camera;
        camera.eye = {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(0.9, 2.0)};
        camera.target = {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), 0};
        const lod::View view = scene::makeView(camera, 640, 480, 0.01);
        Drawing leaving(placed, *executor_), plain(placed, *executor_);
        leaving.draw(view, settingsOf(Mode::splat, true, 40'000));
        coarse += leaving.counters().nodesLeftCoarse;
        const double tau = leaving.counters().tauTargetPixels;
        plain.draw(view, settingsOf(Mode::splat, false, ~uint64_t{0}, tau * 1.001));
        EXPECT_TRUE(areSame(leaving.state->image, plain.state->image)) << "round " << round << ", " << tau << " px";
    }
    EXPECT_GT(coarse, 20u);
}

TEST_F(Unrefined, AreTheSameWhateverWasDrawnBefore) {
    const lod::View front = look({0.2, 0.1, 1.8}, {0, 0, 0}), behind = look({0.3, 0.2, -2.5}, {0, 0, 0});
    for (const Mode mode : {Mode::splat, Mode::surface, Mode::pullpush, Mode::ewa}) {
        Drawing fresh(placed_, *executor_), used(placed_, *executor_);
        fresh.draw(front, settingsOf(mode, true));
        used.draw(behind, settingsOf(mode, true));  // what is hidden there is seen from the front
        used.draw(front, settingsOf(mode, true));
        const char* const name = render::reconstructionOf(mode).name;
        EXPECT_TRUE(areSame(fresh.state->image, used.state->image)) << name;
        EXPECT_EQ(fresh.counters().tauTargetPixels, used.counters().tauTargetPixels) << name;
        EXPECT_EQ(fresh.counters().nodesLeftCoarse, used.counters().nodesLeftCoarse) << name;
        EXPECT_EQ(fresh.counters().nodesLeftCoarse > 0, mode == Mode::splat || mode == Mode::surface) << name;
    }
}

/// Frames that nobody waits for refine all that they can: what was known is of another view.
TEST_F(Unrefined, AreOfOneViewAlone) {
    const lod::View front = look({0.2, 0.1, 1.8}, {0, 0, 0}), behind = look({0.3, 0.2, -2.5}, {0, 0, 0});
    Drawing one(placed_, *executor_);
    one.draw(front, settingsOf(Mode::splat, true));
    const render::Image first = one.state->image;
    EXPECT_GT(one.counters().nodesLeftCoarse, 0u);
    ASSERT_TRUE(render::renderResident(*one.state, front, settingsOf(Mode::splat, true)));
    EXPECT_TRUE(areSame(first, one.state->image)) << "once more";
    one.frame(behind, settingsOf(Mode::splat, true));
    EXPECT_EQ(one.counters().nodesLeftCoarse, 0u);
    Drawing plain(placed_, *executor_);
    for (int k = 0; k < 12; ++k) {
        one.frame(behind, settingsOf(Mode::splat, true));
        plain.frame(behind, settingsOf(Mode::splat, false));
    }
    EXPECT_TRUE(areSame(one.state->image, plain.state->image));
}

TEST_F(Unrefined, NodesAreDrawnWholeAndNothingBelowThem) {
    const lod::View view = look({0, 0, 1.8}, {0, 0, 0});
    const auto& ball = *placed_[1].store;
    const std::vector<const lod::Hierarchy*> hierarchies{&ball.hierarchy};
    const std::vector<lod::Instance> instances{placed_[1].place};
    const std::vector<std::vector<uint8_t>> drawable{std::vector<uint8_t>(ball.hierarchy.chunks(), 1)};
    const auto cutOf = [&](std::span<const lod::PlacedNode> unrefined) {
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::Budgets budgets{0.05};
        budgets.unrefined = unrefined;
        lod::selectCut({hierarchies, instances, {}}, {drawable}, view, budgets, scratch, cut);
        return cut;
    };
    const lod::Cut all = cutOf({});
    const auto isBelow = [&](uint32_t node, uint32_t ancestor) {
        while (node != 0 && node != ancestor) node = ball.hierarchy.nodes[node].parent;
        return node == ancestor;
    };
    size_t looked = 0;
    for (const lod::CutDraw& d : all.draw) {
        const lod::Node& node = ball.hierarchy.nodes[d.node];
        if (d.node == 0 || node.isLeaf()) continue;
        ++looked;
        const std::array<lod::PlacedNode, 1> unrefined{{{0, d.node}}};
        const lod::Cut cut = cutOf(unrefined);
        for (const lod::CutDraw& other : cut.draw) {
            if (other.node == d.node)
                EXPECT_GE(other.errorCode, node.errorCode) << "all of its records that are no other's";
            else
                EXPECT_FALSE(isBelow(other.node, d.node)) << other.node << " below " << d.node;
        }
        const auto beside = [&](const lod::Cut& c) {
            return std::count_if(c.draw.begin(), c.draw.end(), [&](const auto& o) { return !isBelow(o.node, d.node); });
        };
        EXPECT_EQ(beside(cut), beside(all)) << "all else is as it was";
        EXPECT_EQ(cut.tauEffective, all.tauEffective) << "what is not seen is no error";
    }
    EXPECT_GT(looked, 5u);
}

}  // namespace
}  // namespace stipple
