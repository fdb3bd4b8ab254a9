// Nodes of points that are hidden are left out (engine/cpu/hidden_nodes.h), and no bit of any picture tells: on orbits
// and walks, in jumps, through a hole, whatever was drawn before. What the pictures rest on, that no record claims a
// pixel beyond or a depth before what is said of its node, is held to the kernels themselves. Each with its control.
#include "engine/cpu/hidden_nodes.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>

#include "engine/base/rng.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/kernels.h"
#include "engine/render/frame_passes.h"
#include "engine/scene/camera.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using render::Mode;

/// A wall with a hole in its middle, and balls behind it.
class HiddenNodes : public testing::Test {
  protected:
    static constexpr double kEdge = 4.0 / 600, kHole = 0.2;  // of the wall's points; half of the hole's side

    void SetUp() override {
        std::vector<test::TestPoint> wall;
        for (int y = -300; y <= 300; ++y)
            for (int x = -360; x <= 360; ++x) {
                const glm::dvec3 at(x * kEdge, y * kEdge, 0);
                if (std::max(std::abs(at.x), std::abs(at.y)) < kHole) continue;
                wall.push_back({at, {0, 0, 1}, 0x4060a0, static_cast<float>(kEdge)});
            }
        test::writePly(folder_ / "wall.ply", wall, true, true);
        test::writePly(folder_ / "ball.ply", test::bumpySphere(20'000, 3));
        wall_ = test::buildAndOpen(folder_ / "wall.ply", folder_ / "wall.stipple", *executor_, 2048);
        ball_ = test::buildAndOpen(folder_ / "ball.ply", folder_ / "ball.stipple", *executor_, 512);
        placed_.push_back({wall_, {}, {}});
        Rng rng(2);
        for (int k = 0; k < 9; ++k) {
            lod::Instance place;
            place.scale = k == 4 ? 0.4 : rng.uniform(0.2, 0.4);
            const double turn = rng.uniform(0, 6);
            place.rotation = glm::dmat3(std::cos(turn), std::sin(turn), 0, -std::sin(turn), std::cos(turn), 0, 0, 0, 1);
            place.translation = {k % 3 - 1.0, k / 3 - 1.0, k == 4 ? -1.5 : rng.uniform(-2, -1)};
            placed_.push_back({ball_, place, {}});
        }
    }

    static lod::View look(const glm::dvec3& eye, const glm::dvec3& target, bool isOrthographic) {
        scene::Camera camera;
        camera.eye = eye;
        camera.target = target;
        camera.orthoWidth = isOrthographic ? 2.2 : 0;
        lod::View view = scene::makeView(camera, 208, 150, 0.01);  // neither is a number of whole tiles
        return view;
    }
    static lod::View front(bool isOrthographic) { return look({0, 0, 2.2}, {0, 0, 0}, isOrthographic); }
    /// Before the wall, around it, through its hole, behind it, and back.
    static std::vector<lod::View> walk(bool isOrthographic) {
        std::vector<lod::View> views;
        const auto add = [&](const glm::dvec3& eye, const glm::dvec3& target) {
            views.push_back(look(eye, target, isOrthographic));
        };
        for (int k = 0; k < 4; ++k) views.push_back(front(isOrthographic));
        for (int k = 0; k < 10; ++k) add({2.2 * std::sin(0.1 * k), 0.1, 2.2 * std::cos(0.1 * k)}, {0, 0, -0.3});
        for (int k = 0; k < 8; ++k) add({0.02 * k, 0.01, 2 - 0.5 * k}, {0, 0, -6});  // through the hole and a ball
        add({0, 0.3, -4}, {0, 0, 0});
        for (int k = 0; k < 20; ++k) views.push_back(front(isOrthographic));
        add({0.6, 0.2, 2}, {0.2, 0.2, 0});
        add({-0.6, -0.3, 1.2}, {0.2, 0.2, 0});
        return views;
    }
    static render::FrameSettings settingsOf(Mode mode, bool mayHide, double tau) {
        render::FrameSettings settings = test::drawnAs(mode, tau);
        settings.mayHideNodes = mayHide;
        return settings;
    }
    static void expectSame(const render::Image& a, const render::Image& b, const std::string& what) {
        EXPECT_TRUE(a.rgba == b.rgba) << what;
        EXPECT_TRUE(a.depth == b.depth && a.normal == b.normal && a.linear == b.linear) << what;
    }

    const test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::shared_ptr<const lod::Store> wall_, ball_;
    std::vector<render::PlacedStore> placed_;
};

/// A backend and what it draws, from frame to frame.
struct Drawing {
    Drawing(const std::vector<render::PlacedStore>& placed, Executor& executor, const cpu::Kernels* kernels = nullptr)
        : backend(cpu::makeCpuBackend(executor, kernels)),
          state(render::makeFrameState(placed, *backend, executor, {})) {}
    const render::Image& draw(const lod::View& view, const render::FrameSettings& settings) {
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
        return state->image;
    }
    std::unique_ptr<render::Backend> backend;
    std::unique_ptr<render::FrameState> state;
};

TEST_F(HiddenNodes, ChangeNoBitOfAnyPicture) {
    for (const Mode mode : {Mode::pullpush, Mode::points, Mode::splat, Mode::surface})
        for (const bool isOrthographic : {false, true})
            for (const double tau : {1e-4, 1.5}) {
                Drawing skipping(placed_, *executor_), drawing(placed_, *executor_);
                uint64_t mostHidden = 0, framesThatHide = 0;
                size_t frame = 0;
                for (const lod::View& view : walk(isOrthographic)) {
                    const render::Image& a = skipping.draw(view, settingsOf(mode, true, tau));
                    const render::Image& b = drawing.draw(view, settingsOf(mode, false, tau));
                    expectSame(a, b,
                               fmt::format("{} orthographic {} tau {} frame {}", render::reconstructionOf(mode).name,
                                           isOrthographic, tau, frame++));
                    const FrameCounters &c = skipping.state->counters, &all = drawing.state->counters;
                    EXPECT_EQ(all.nodesHidden + all.recordsHidden, 0u);
                    EXPECT_EQ(c.recordsDrawn, all.recordsDrawn);
                    EXPECT_LE(c.nodesHidden, c.nodesDrawn);
                    mostHidden = std::max(mostHidden, c.recordsHidden);
                    framesThatHide += c.nodesHidden > 0 ? 1 : 0;
                }
                // (At 1.5 px points alone leave pixels open, which hide nothing.)
                if (tau > 1 && !render::reconstructionOf(mode).fillsSplats) continue;
                EXPECT_GT(mostHidden, tau > 1 ? 2'000u : 30'000u) << render::reconstructionOf(mode).name;
                EXPECT_GT(framesThatHide, 15u) << "it is not for nothing that they are equal";
            }
}

TEST_F(HiddenNodes, AreTheSameForAnyThreadsAndModesThatBlendHideNone) {
    const auto serial = makeSerialExecutor(), three = makeTbbExecutor(3);
    for (const Mode mode : {Mode::pullpush, Mode::surface, Mode::ewa, Mode::pullpushExact}) {
        Drawing one(placed_, *serial), many(placed_, *three);
        uint64_t hidden = 0;
        for (size_t k = 0; k < 16; ++k) {
            const lod::View view = walk(false)[k];
            const render::FrameSettings settings = settingsOf(mode, true, 1e-4);
            expectSame(one.draw(view, settings), many.draw(view, settings), "threads");
            EXPECT_EQ(one.state->counters.nodesHidden, many.state->counters.nodesHidden);
            EXPECT_EQ(one.state->counters.recordsHidden, many.state->counters.recordsHidden);
            hidden += one.state->counters.nodesHidden;
        }
        const bool hides = mode == Mode::pullpush || mode == Mode::surface;
        EXPECT_EQ(hidden > 0, hides) << render::reconstructionOf(mode).name;
    }
}

TEST_F(HiddenNodes, AreSeenThroughAHole) {
    for (const bool isOrthographic : {false, true}) {
        Drawing skipping(placed_, *executor_);
        const lod::View view = front(isOrthographic);
        for (int k = 0; k < 4; ++k) skipping.draw(view, settingsOf(Mode::surface, true, 1e-4));
        EXPECT_GT(skipping.state->counters.nodesHidden, 0u);
        const render::Image& image = skipping.state->image;
        const size_t middle = size_t{75} * 208 + 104, beside = size_t{75} * 208 + 30;
        EXPECT_NEAR(image.depth[middle], 2.2 + 1.5 - 0.4, 0.05) << "the ball behind it";
        EXPECT_NEAR(image.depth[beside], 2.2, 0.01) << "the wall";
    }
}

/// Keys of one node alone, with nothing before it.
struct Claimed {
    std::vector<std::pair<uint32_t, uint32_t>> pixels;  ///< and bits of the depth
    bool hasNear = false;                               ///< some of its records lie before the near plane
};
class Claims {
  public:
    explicit Claims(const shared::FrameConstants& f)
        : f_(f), k_(f.orthographic != 0 ? *cpu::bestKernels().orthographic : cpu::bestKernels()) {}
    Claimed of(const shared::DrawNode& node, std::span<const shared::PointRecord> records, bool areDiscs,
               bool besideToo) const {
        Claimed claimed;
        records = records.first(std::min<size_t>(records.size(), node.count));
        for (const auto& r : records)
            claimed.hasNear = claimed.hasNear || !(shared::recordPlace(node, r).z > f_.nearPlane);
        for (size_t first = 0; first < records.size(); first += shared::kRecordsPerBlock) {
            const auto count = static_cast<uint32_t>(std::min<size_t>(records.size() - first, 256));
            areDiscs ? addDiscs(node, records.data() + first, count, claimed)
                     : addPoints(node, records.data() + first, count, besideToo, claimed);
        }
        return claimed;
    }

  private:
    void addPoints(const shared::DrawNode& node, const shared::PointRecord* records, uint32_t count, bool besideToo,
                   Claimed& to) const {
        cpu::ProjectedBlock block;
        k_.projectBlock(f_, node, records, count, besideToo, block);
        for (uint32_t i = 0; i < count; ++i)
            if (block.pixel[i] < cpu::kWidePixel) to.pixels.emplace_back(block.pixel[i], block.depth[i]);
    }
    void addDiscs(const shared::DrawNode& node, const shared::PointRecord* records, uint32_t count, Claimed& to) const {
        cpu::SplatBlock b;
        k_.placeSplats(f_, node, records, count, {}, b);
        std::vector<cpu::PlacedSplat> splats;
        std::vector<uint32_t> places;
        for (uint32_t i = 0; i < count; ++i) {
            if (b.keep[i] == 0) continue;
            places.push_back(static_cast<uint32_t>(splats.size()));
            splats.push_back({b.cx[i], b.cy[i], b.cz[i], b.nx[i], b.ny[i], b.nz[i], b.radius[i], i | b.alone[i]});
        }
        std::vector<uint64_t> keys(size_t{f_.width} * f_.height, shared::kNoKey);
        std::vector<uint8_t> runs(keys.size() / cpu::Visibility::kRun + 1);
        for (uint32_t y = 0; y < f_.height; y += cpu::SplatTile::kHeight)
            for (uint32_t x = 0; x < f_.width; x += cpu::SplatTile::kWidth)
                k_.splatTile(f_, splats.data(), places.data(), places.size(),
                             {x, y, std::min(cpu::SplatTile::kWidth, f_.width - x),
                              std::min(cpu::SplatTile::kHeight, f_.height - y)},
                             {keys.data(), runs.data()});
        for (uint32_t p = 0; p < keys.size(); ++p)
            if (keys[p] != shared::kNoKey) to.pixels.emplace_back(p, shared::keyDepthBits(keys[p]));
    }
    const shared::FrameConstants& f_;
    const cpu::Kernels& k_;
};

size_t countBeyond(const cpu::NodeReach& reach, const Claimed& claimed, uint32_t width) {
    size_t beyond = 0;
    for (const auto& [pixel, depth] : claimed.pixels) {
        const int x = static_cast<int>(pixel % width), y = static_cast<int>(pixel / width);
        beyond += depth < reach.nearest || x < reach.firstX || x > reach.lastX || y < reach.firstY || y > reach.lastY;
    }
    return beyond;
}

TEST_F(HiddenNodes, LieWhereItIsSaidThatTheyReach) {
    Rng rng(7);
    size_t known = 0, around = 0, border = 0, claimed = 0;
    std::array<size_t, 4> controls{};
    for (int round = 0; round < 60; ++round) {
        const bool isOrthographic = round % 2 == 1;
        const glm::dvec3 target(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-2, 0));
        const glm::dvec3 away = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        const double distance = std::exp(rng.uniform(-2.5, 2));
        Drawing drawing(placed_, *executor_);
        const bool areDiscs = round % 4 < 2, besideToo = !areDiscs && rng.uniform(0, 1) < 0.6;
        const Mode mode = areDiscs ? Mode::splat : besideToo ? Mode::pullpush : Mode::points;
        drawing.draw(look(target + distance * away, target, isOrthographic), settingsOf(mode, true, 4));
        const render::DrawList& draws = drawing.state->draws;
        const render::DrawBatch& points = draws.points();
        ASSERT_EQ(draws.pointBounds.size(), points.nodes.size());
        const Claims claims(draws.frame);
        for (size_t n = 0; n < points.nodes.size(); ++n) {
            shared::DrawNode node = points.nodes[n];
            if (rng.uniform(0, 1) < 0.3) {  // as wind bends it
                node.axisY.x += 0.2f * node.axisY.y;
                node.octantMask |= shared::kNodeBent | shared::kNodeTurned;
            }
            const bool isWall = points.instances[n] == 0;
            const auto chunk = lod::readChunk(isWall ? *wall_ : *ball_, points.keys[n].chunk);
            ASSERT_TRUE(chunk);
            const Claimed of = claims.of(node, chunk->records, areDiscs, besideToo);
            const auto reach = [&](render::NodeBounds bounds) {
                return cpu::reachOf(draws.frame, node, bounds, areDiscs, besideToo);
            };
            const cpu::NodeReach r = reach(draws.pointBounds[n]);
            EXPECT_FALSE(r.isKnown && of.hasNear) << "about the eye nothing is dropped";
            around += of.hasNear ? 1 : 0;
            if (!r.isKnown) continue;
            ++known;
            claimed += of.pixels.size();
            border += r.firstX == 0 || r.lastX == 207 ? 1 : 0;
            EXPECT_EQ(countBeyond(r, of, 208), 0u) << round << " node " << n;
            cpu::NodeReach tooFar = r, tooSmall = r;
            tooFar.nearest = shared::floatBitsToUint(1.02f * shared::uintBitsToFloat(r.nearest));
            tooSmall.firstX += 6;
            controls[0] += countBeyond(tooFar, of, 208);
            controls[1] += countBeyond(tooSmall, of, 208);
            render::NodeBounds wrong = draws.pointBounds[n];
            wrong.radius = 0;
            controls[2] += areDiscs ? countBeyond(reach(wrong), of, 208) : 0;
            wrong = draws.pointBounds[n];
            wrong.high[1] = static_cast<uint16_t>((wrong.low[1] + wrong.high[1]) / 2);
            controls[3] += countBeyond(reach(wrong), of, 208);
        }
    }
    EXPECT_GT(known, 500u);
    EXPECT_GT(claimed, 100'000u);
    EXPECT_GT(around, 20u);
    EXPECT_GT(border, 50u);
    for (const size_t found : controls) EXPECT_GT(found, 100u);
}

TEST_F(HiddenNodes, AreNotLeftOutForNothing) {
    // Negative control: of balls whose nodes are said to be but a corner of what they are, some are left out that the
    // hole shows.
    Drawing skipping(placed_, *executor_);
    const lod::View view = front(false);
    const render::FrameSettings settings = settingsOf(Mode::surface, true, 1e-4);
    const render::Image truth = skipping.draw(view, settings);
    render::DrawList& draws = skipping.state->draws;
    render::RenderRequest request;
    request.draws = &draws;
    request.mode = settings.mode;
    request.passes = render::passesOf(settings.mode, render::contentOf(draws), draws.effects);
    request.wantDepthAndNormal = request.mayHideNodes = true;
    const auto draw = [&] {
        render::Image image;
        for (int k = 0; k < 40; ++k) EXPECT_TRUE(skipping.backend->render(request, image));
        return image;
    };
    expectSame(draw(), truth, "as they are");
    size_t changed = 0;
    for (const uint16_t corner : {uint16_t{0}, uint16_t{65535}}) {
        for (size_t n = 0; n < draws.pointBounds.size(); ++n)
            if (draws.points().instances[n] != 0)
                draws.pointBounds[n] = {{corner, corner, corner}, {corner, corner, corner}, 0};
        changed += draw().rgba == truth.rgba ? 0 : 1;
    }
    EXPECT_GT(changed, 0u);
}

std::atomic<size_t> tilesMeasured{0};
void countMeasured(const uint64_t* keys, size_t stride, uint32_t rows, uint32_t n, uint32_t* farthest) {
    ++tilesMeasured;
    cpu::bestKernels().farthestOf(keys, stride, rows, n, farthest);
}

TEST_F(HiddenNodes, CostATestInSixteenFramesWhereNothingIsHidden) {
    cpu::Kernels counting = cpu::bestKernels();
    counting.farthestOf = countMeasured;
    const std::vector<render::PlacedStore> open{placed_.begin(), placed_.begin() + 1};  // the wall alone
    Drawing drawing(open, *executor_, &counting);
    const lod::View whole = look({0, 0, 8}, {0, 0, 0}, false);
    size_t frames = 0;
    for (int k = 0; k < 50; ++k) {
        const size_t before = tilesMeasured;
        drawing.draw(whole, settingsOf(Mode::surface, true, 1));
        frames += tilesMeasured > before ? 1 : 0;
        EXPECT_EQ(drawing.state->counters.nodesHidden, 0u);
        EXPECT_TRUE(k > 0 || tilesMeasured == 0) << "a single picture is not held up";
    }
    EXPECT_EQ(frames, 4u) << "the second, the 18th, the 34th, the 50th";
    for (int k = 0; k < 50; ++k) drawing.draw(front(false), settingsOf(Mode::surface, false, 1));
    const size_t before = tilesMeasured;
    drawing.draw(front(false), settingsOf(Mode::surface, false, 1));
    EXPECT_EQ(tilesMeasured, before) << "switched off";
}

}  // namespace
}  // namespace stipple
