// Several views of one frame: two eyes, and a light that casts shadows. They share what is resident and what may be
// drawn, and what nobody sees becomes coarser first.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/base/hash.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/render/views.h"
#include "lod/cut/views.h"
#include "lod/primitives/kinds.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using lod::ViewRequest;

constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

class Views : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        folder_ = new test::TempFolder;
        const auto executor = makeSerialExecutor();
        test::writePly(*folder_ / "a.ply", test::bumpySphere(40'000, 1));
        store_ = test::buildAndOpen(*folder_ / "a.ply", *folder_ / "a.stipple", *executor);
    }
    static void TearDownTestSuite() {
        store_.reset();
        delete folder_;
        folder_ = nullptr;
    }
    /// From `eye` to the middle of the sphere.
    static lod::View lookFrom(const glm::dvec3& eye, uint32_t size = 300) {
        lod::View view;
        view.width = view.height = size;
        view.focalPixels = 1.2 * size;
        view.eye = eye;
        view.forward = glm::normalize(-eye);
        view.right = glm::normalize(glm::cross(view.forward, glm::dvec3(0.1, 1, 0.05)));
        view.down = glm::cross(view.forward, view.right);
        view.nearPlane = 1e-4;
        return view;
    }
    static std::vector<ViewRequest> eyes(double tau) {
        return {{lookFrom({-0.03, 0.2, 2.5}), tau, false}, {lookFrom({0.03, 0.2, 2.5}), tau, false}};
    }
    /// What a sun sees: parallel rays over all of the scene.
    static ViewRequest shadow(double tau) {
        lod::View view = lookFrom({2, 3, 1}, 512);
        view.isOrthographic = true;
        view.focalPixels = 512 / 2.6;
        return {view, tau, true};
    }
    lod::CutScene scene() const { return {hierarchies_, instances_, {}}; }
    const lod::Hierarchy& h() const { return store_->hierarchy; }
    std::vector<std::vector<uint8_t>> all() const { return {std::vector<uint8_t>(h().chunks(), 1)}; }
    static uint64_t recordsOf(const lod::Cut& cut) { return cut.counters.recordsDrawn + cut.counters.trianglesDrawn; }
    static uint64_t recordsOf(const lod::CutOfViews& cuts) {
        uint64_t sum = 0;
        for (const lod::Cut& cut : cuts.views) sum += recordsOf(cut);
        return sum;
    }
    static void expectSame(const lod::Cut& a, const lod::Cut& b) {
        ASSERT_EQ(a.draw.size(), b.draw.size());
        for (size_t k = 0; k < a.draw.size(); ++k) {
            EXPECT_EQ(a.draw[k].chunk, b.draw[k].chunk);
            EXPECT_EQ(a.draw[k].first, b.draw[k].first);
            EXPECT_EQ(a.draw[k].count, b.draw[k].count);
            EXPECT_EQ(a.draw[k].errorCode, b.draw[k].errorCode);
            EXPECT_EQ(a.draw[k].octantMask, b.draw[k].octantMask);
        }
        EXPECT_EQ(a.tauTarget, b.tauTarget);
        EXPECT_EQ(a.tauEffective, b.tauEffective);
        EXPECT_EQ(a.truncated, b.truncated);
        EXPECT_EQ(a.keep, b.keep);
        ASSERT_EQ(a.wanted.size(), b.wanted.size());
        for (size_t k = 0; k < a.wanted.size(); ++k) {
            EXPECT_EQ(a.wanted[k].chunk, b.wanted[k].chunk);
            EXPECT_EQ(a.wanted[k].priority, b.wanted[k].priority);
        }
    }

    static test::TempFolder* folder_;
    static std::shared_ptr<const lod::Store> store_;
    std::vector<const lod::Hierarchy*> hierarchies_{&store_->hierarchy};
    std::vector<lod::Instance> instances_{lod::Instance{}};
    std::unique_ptr<Executor> executor_ = makeSerialExecutor();
    lod::ViewsScratch scratch_;
    lod::CutOfViews cuts_;
};
test::TempFolder* Views::folder_ = nullptr;
std::shared_ptr<const lod::Store> Views::store_;

TEST_F(Views, OneIsWhatSelectCutSays) {
    Rng rng(3);
    for (int k = 0; k < 60; ++k) {
        auto drawable = all();
        for (uint8_t& d : drawable[0]) d = k % 3 == 0 || rng.below(5) > 0 ? 1 : 0;
        const uint64_t budget = k % 2 == 0 ? kNoLimit : static_cast<uint64_t>(std::exp2(rng.uniform(2, 16)));
        const double tau = std::exp2(rng.uniform(-3, 4));
        lod::View view = lookFrom({rng.normal(), rng.normal(), 1.4 + rng.uniform()});
        view.isOrthographic = k % 5 == 0;
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::selectCut(scene(), {drawable}, view, {tau, budget}, scratch, cut);
        for (const bool isSecondary : {false, true}) {
            const std::vector<ViewRequest> one{{view, tau, isSecondary}};
            lod::selectCuts(scene(), {drawable}, one, budget, scratch_, cuts_);
            expectSame(cuts_.views[0], cut);
        }
    }
}

TEST_F(Views, TwoEyesHaveOneAccuracyAndOneBudget) {
    const auto drawable = all();
    int bound = 0;
    for (uint64_t budget = 500; budget < 200'000; budget = budget * 3 / 2) {
        lod::selectCuts(scene(), {drawable}, eyes(0.5), budget, scratch_, cuts_);
        const double tau = cuts_.views[0].tauTarget;
        EXPECT_EQ(cuts_.views[1].tauTarget, tau);
        EXPECT_LE(recordsOf(cuts_), budget);
        if (tau <= 0.5) continue;
        ++bound;
        // A step finer is too much.
        lod::CutOfViews finer;
        lod::selectCuts(scene(), {drawable}, eyes(tau * std::exp2(-1.5 / 32)), kNoLimit, scratch_, finer);
        EXPECT_GT(recordsOf(finer), budget);
    }
    EXPECT_GT(bound, 5);
}

TEST_F(Views, SecondaryOnesBecomeCoarserFirst) {
    const auto drawable = all();
    std::vector<ViewRequest> views = eyes(1);
    views.push_back(shadow(1));
    lod::selectCuts(scene(), {drawable}, views, kNoLimit, scratch_, cuts_);
    const uint64_t whole = recordsOf(cuts_), seen = recordsOf(cuts_.views[0]) + recordsOf(cuts_.views[1]);
    views[2].errorPixels = 1e9;
    lod::selectCuts(scene(), {drawable}, views, kNoLimit, scratch_, cuts_);
    ASSERT_LT(recordsOf(cuts_.views[2]), 30u) << "overviews alone";
    // Under a budget the roots' own records are set aside for it.
    uint64_t least = 0;
    for (const lod::Hierarchy* h : scene().hierarchies) least += h->ownRecordsOf(h->nodes[0]);
    views[2].errorPixels = 1;
    ASSERT_GT(whole - seen, 4 * least);
    int coarseShadow = 0, coarseEyes = 0;
    double lastTau = 0;
    for (uint64_t budget = whole + 1000; budget > 200; budget = budget * 31 / 32) {
        lod::selectCuts(scene(), {drawable}, views, budget, scratch_, cuts_);
        EXPECT_LE(recordsOf(cuts_), budget);
        const double eye = cuts_.views[0].tauTarget, sun = cuts_.views[2].tauTarget;
        EXPECT_EQ(cuts_.views[1].tauTarget, eye);
        if (budget >= seen + least) EXPECT_EQ(eye, 1) << budget << ": the shadow gives way first";
        if (eye > 1) {
            ++coarseEyes;
            EXPECT_LE(recordsOf(cuts_.views[2]), 2 * least + 50) << budget << ": and as far as it can";
        }
        coarseShadow += sun > 1 && eye == 1 ? 1 : 0;
        EXPECT_GE(sun, lastTau) << "less never gives more";
        lastTau = eye == 1 ? sun : 0;
    }
    EXPECT_GT(coarseShadow, 5);
    EXPECT_GT(coarseEyes, 5);
    // The order of the requests says nothing.
    std::vector<ViewRequest> turned{views[2], views[0], views[1]};
    lod::CutOfViews other;
    lod::selectCuts(scene(), {drawable}, views, seen, scratch_, cuts_);
    lod::ViewsScratch fresh;
    lod::selectCuts(scene(), {drawable}, turned, seen, fresh, other);
    expectSame(other.views[0], cuts_.views[2]);
    expectSame(other.views[1], cuts_.views[0]);
}

TEST_F(Views, WhatTheyMissIsAskedForOnceTheMostUrgentFirst) {
    Rng rng(9);
    std::vector<ViewRequest> views = eyes(0.5);
    views.push_back(shadow(0.5));
    int shared = 0, own = 0;
    for (int k = 0; k < 20; ++k) {
        auto drawable = all();
        for (uint8_t& d : drawable[0]) d = rng.below(3) > 0 ? 1 : 0;
        lod::selectCuts(scene(), {drawable}, views, kNoLimit, scratch_, cuts_);
        std::set<uint32_t> seen, any, kept;
        for (size_t v = 0; v < views.size(); ++v) {
            for (const lod::CutWanted& w : cuts_.views[v].wanted) {
                shared += v < 2 && seen.count(w.chunk) ? 1 : 0;
                any.insert(w.chunk);
                if (v < 2) seen.insert(w.chunk);
            }
            for (const auto& [source, chunk] : cuts_.views[v].keep) kept.insert(chunk);
        }
        std::set<uint32_t> asked;
        float leastSeen = HUGE_VALF, mostUnseen = 0;
        for (const lod::CutWanted& w : cuts_.merged.wanted) {
            EXPECT_TRUE(asked.insert(w.chunk).second) << "twice";
            if (seen.count(w.chunk))
                leastSeen = std::min(leastSeen, w.priority);
            else
                mostUnseen = std::max(mostUnseen, w.priority);
            own += seen.count(w.chunk) ? 0 : 1;
        }
        EXPECT_EQ(asked, any);
        EXPECT_LT(mostUnseen, leastSeen) << "what is seen comes first";
        std::set<uint32_t> keeps;
        for (const auto& [source, chunk] : cuts_.merged.keep) EXPECT_TRUE(keeps.insert(chunk).second);
        EXPECT_EQ(keeps, kept);
    }
    EXPECT_GT(shared, 20);
    EXPECT_GT(own, 20);
}

TEST_F(Views, ThePlanOfAllIsOneAndFits) {
    std::vector<ViewRequest> views = eyes(0.5);
    views.push_back(shadow(0.5));
    lod::ResidentPlan whole;
    lod::planResident(scene(), views, kNoLimit, kNoLimit, {}, scratch_, cuts_, whole);
    EXPECT_TRUE(whole.isComplete());
    // It is less than three plans together, and no less than what each needs.
    uint64_t apart = 0;
    for (const ViewRequest& of : views) {
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::ResidentPlan plan;
        lod::planResident(scene(), of.view, {0.5, kNoLimit}, kNoLimit, {}, scratch, cut, plan);
        apart += plan.bytes;
        for (size_t c = 0; c < plan.chunks[0].size(); ++c) EXPECT_LE(plan.chunks[0][c], whole.chunks[0][c]);
    }
    EXPECT_LT(whole.bytes, apart);
    for (const uint64_t budget : {whole.bytes / 2, whole.bytes / 5}) {
        lod::ResidentPlan plan;
        lod::planResident(scene(), views, kNoLimit, budget, {}, scratch_, cuts_, plan);
        EXPECT_LE(plan.bytes, budget);
        EXPECT_FALSE(plan.isComplete());
        EXPECT_GT(plan.bytes, budget / 2);
    }
}

TEST_F(Views, AreDrawnAsEachAlone) {
    const auto backend = cpu::makeCpuBackend(*executor_);
    std::vector<ViewRequest> views = eyes(1);
    views.push_back(shadow(2));
    render::FrameSettings settings;
    settings.wantDepthAndNormal = true;
    auto state = render::makeFrameState({store_}, *backend, *executor_, {});
    render::ViewsFrame frame;
    for (int k = 0; k < 60; ++k) {
        const auto drawn = render::renderViews(*state, views, settings, frame);
        ASSERT_TRUE(drawn) << drawn.error().line();
        executor_->wait();
        if (k > 0 && frame.cut.merged.wanted.empty()) break;
    }
    ASSERT_TRUE(frame.cut.merged.wanted.empty());
    ASSERT_EQ(frame.images.size(), views.size());
    std::set<uint64_t> different;
    for (size_t v = 0; v < views.size(); ++v) {
        render::FrameSettings alone = settings;
        alone.budgets.errorPixels = views[v].errorPixels;
        const render::Image image = test::renderView(store_, *backend, *executor_, views[v].view, alone);
        EXPECT_EQ(frame.images[v].rgba, image.rgba) << v;
        EXPECT_EQ(frame.images[v].depth, image.depth) << v;
        different.insert(hashBytes(image.rgba.data(), image.rgba.size() * sizeof(image.rgba[0])));
    }
    EXPECT_EQ(different.size(), views.size());
    // What is resident is there once.
    std::set<uint32_t> kept;
    for (const auto& [source, chunk] : frame.cut.merged.keep) kept.insert(chunk);
    uint64_t bytes = 0;
    for (const uint32_t chunk : kept) bytes += lod::decodedBytes(h(), chunk);
    EXPECT_LE(bytes, state->streamer->counters().residentBytes);
    EXPECT_EQ(state->streamer->counters().uploads, state->streamer->counters().requests);
}

}  // namespace
}  // namespace stipple
