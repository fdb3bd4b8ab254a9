// Under a byte budget a picture hangs on the scene, the view and the budget: not on when chunks arrive, not on what was
// drawn before.
#include <gtest/gtest.h>

#include <set>

#include "engine/cpu/cpu_backend.h"
#include "lod/cut/resident.h"
#include "lod/primitives/kinds.h"
#include "tests/support/curves.h"
#include "tests/support/meshes.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

/// Work that was started is done in an order drawn by lot; `some` does a part of it, as a slow disc would.
class LotteryExecutor final : public Executor {
  public:
    explicit LotteryExecutor(uint64_t seed) : rng_(seed) {}
    void parallelFor(size_t count, size_t, const std::function<void(size_t, size_t)>& body) override {
        if (count > 0) body(0, count);
    }
    void run(std::function<void()> task) override { tasks_.push_back(std::move(task)); }
    void wait() override { some(tasks_.size()); }
    int threads() const override { return 1; }
    void some(size_t count) {
        for (; count > 0 && !tasks_.empty(); --count) {
            std::swap(tasks_[rng_.below(tasks_.size())], tasks_.back());
            const auto task = std::move(tasks_.back());
            tasks_.pop_back();
            task();
        }
    }

  private:
    Rng rng_;
    std::vector<std::function<void()>> tasks_;
};

class Resident : public testing::Test {
  protected:
    void SetUp() override {
        test::writePly(folder_ / "a.ply", test::bumpySphere(60'000, 1));
        stores_.push_back(test::buildAndOpen(folder_ / "a.ply", folder_ / "a.stipple", *executor_));
        test::MeshRecipe recipe;
        recipe.grow.kind = "rock";
        recipe.grow.triangles = 60'000;
        recipe.grow.textureSize = 512;
        stores_.push_back(test::growMeshStore(recipe, folder_ / "b.stipple", *executor_));
        stores_.push_back(test::buildCurves(test::curls({}), folder_ / "c.stipple", *executor_));
    }
    uint64_t bytesOf(const lod::Store& store) const {
        uint64_t sum = 0;
        for (uint32_t n = 0; n < store.hierarchy.chunks(); ++n) sum += lod::decodedBytes(store.hierarchy, n);
        return sum;
    }
    static lod::View turned(const lod::View& view, double angle) {
        lod::View out = view;
        const glm::dvec3 centre = view.eye + view.forward * glm::length(view.eye);
        const auto about = [&](const glm::dvec3& v) {
            return glm::dvec3(std::cos(angle) * v.x + std::sin(angle) * v.z, v.y,
                              -std::sin(angle) * v.x + std::cos(angle) * v.z);
        };
        out.eye = centre + about(view.eye - centre);
        out.forward = about(view.forward);
        out.right = about(view.right);
        out.down = about(view.down);
        return out;
    }
    struct Picture {
        std::vector<uint32_t> rgba;
        double error = 0;
        bool isComplete = false;
        bool operator==(const Picture& other) const {
            return rgba == other.rgba && error == other.error && isComplete == other.isComplete;
        }
    };
    /// `seed` 0: at once and in order; otherwise after other views, some of whose chunks are still on their way.
    Picture draw(const std::shared_ptr<const lod::Store>& store, uint64_t budget, uint64_t seed, bool isPlanned) {
        LotteryExecutor executor(seed);
        const auto backend = cpu::makeCpuBackend(executor);
        auto state = render::makeFrameState({store}, *backend, executor, {budget, uint64_t{64} << 20, 8});
        const lod::View view = test::fitView(*store, 200, 150);
        render::FrameSettings settings;
        settings.budgets.errorPixels = 0.25;
        Rng rng(seed);
        for (int k = 0; seed > 0 && k < 6; ++k) {
            EXPECT_TRUE(render::renderFrame(*state, turned(view, rng.uniform(-3, 3)), settings));
            executor.some(rng.below(6));
        }
        if (isPlanned) {
            EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
            EXPECT_LE(state->counters.residentBytes, budget);
        } else {  // as the window streams
            for (int k = 0; k < 40; ++k) {
                EXPECT_TRUE(render::renderFrame(*state, view, settings));
                executor.wait();
            }
        }
        Picture out{state->image.rgba, state->cut.tauEffective, state->cut.wanted.empty()};
        executor.wait();
        if (isPlanned) {  // again and again it stays as it is
            EXPECT_TRUE(render::renderResident(*state, view, settings));
            EXPECT_TRUE(state->image.rgba == out.rgba);
        }
        state->streamer.reset();
        return out;
    }
    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    std::vector<std::shared_ptr<const lod::Store>> stores_;
};

TEST_F(Resident, PicturesUnderAByteBudgetHangNeitherOnTimeNorOnWhatWasDrawnBefore) {
    bool differs = false;
    for (const auto& store : stores_)
        for (const double share : {0.1, 0.3}) {
            const auto budget = static_cast<uint64_t>(share * static_cast<double>(bytesOf(*store)));
            const Picture first = draw(store, budget, 0, true), streamed = draw(store, budget, 0, false);
            EXPECT_FALSE(first.isComplete) << store->path << ": the budget must bind";
            for (uint64_t seed = 1; seed <= 4; ++seed) {
                EXPECT_TRUE(draw(store, budget, seed, true) == first) << store->path << " share " << share;
                differs = differs || !(draw(store, budget, seed, false) == streamed);
            }
        }
    EXPECT_TRUE(differs) << "what is streamed by arrival must differ, or this test cannot fail";
}

TEST_F(Resident, WhatFitsIsComplete) {
    for (const auto& store : stores_) {
        const Picture all = draw(store, uint64_t{1} << 30, 0, true);
        EXPECT_TRUE(all.isComplete);
        const lod::View view = test::fitView(*store, 200, 150);
        const std::vector<const lod::Hierarchy*> hierarchies{&store->hierarchy};
        const std::vector<lod::Instance> instances(1);
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::ResidentPlan plan;
        lod::planResident({hierarchies, instances, {}}, view, {0.25}, uint64_t{1} << 30, {}, scratch, cut, plan);
        EXPECT_TRUE(plan.isComplete());
        // Not a byte more than what the view needs, and then not one less.
        EXPECT_TRUE(draw(store, plan.bytes, 3, true) == all);
        EXPECT_FALSE(draw(store, plan.bytes - 1, 3, true).isComplete);
    }
}

TEST_F(Resident, ThePlanIsFullAndHangsTogether) {
    for (const auto& store : stores_) {
        const lod::Hierarchy& h = store->hierarchy;
        const std::vector<const lod::Hierarchy*> hierarchies{&h};
        const std::vector<lod::Instance> instances(1);
        const lod::View view = test::fitView(*store, 200, 150);
        lod::CutScratch scratch;
        lod::Cut cut;
        lod::ResidentPlan plan;
        const auto has = [&](uint32_t n) { return plan.chunks[0][n] != 0; };
        for (const double share : {0.0, 0.01, 0.1, 0.2, 0.4}) {
            const auto budget = static_cast<uint64_t>(share * static_cast<double>(bytesOf(*store)));
            lod::planResident({hierarchies, instances, {}}, view, {0.25}, budget, {}, scratch, cut, plan);
            uint64_t bytes = 0;
            for (uint32_t n = 0; n < h.chunks(); ++n) bytes += has(n) ? lod::decodedBytes(h, n) : 0;
            EXPECT_EQ(bytes, plan.bytes);
            EXPECT_LE(bytes, budget);
            EXPECT_GT(plan.refused, 0u);
            lod::selectCut({hierarchies, instances, {}}, {plan.chunks}, view, {0.25}, scratch, cut);
            std::set<uint32_t> wanted;
            for (const lod::CutWanted& w : cut.wanted) wanted.insert(w.chunk);
            EXPECT_EQ(plan.refused, wanted.size());
            for (uint32_t n = 0; n < h.chunks(); ++n) {
                bool isReached = true;
                if (n < h.nodes.size() && h.isMesh())
                    for (uint32_t k = 0; k < h.groups[n].parents; ++k)
                        isReached = isReached && has(h.parents[h.groups[n].firstParent + k]);
                else if (n > 0 && n < h.nodes.size())
                    isReached = has(h.nodes[n].parent);
                if (has(n))
                    EXPECT_TRUE(isReached) << "a chunk that nothing leads to";
                else if (isReached && wanted.count(n) > 0)
                    EXPECT_GT(plan.bytes + lod::decodedBytes(h, n), budget) << "there is room for " << n;
            }
        }
    }
}

TEST_F(Resident, WhatCannotBeHadTakesNoRoom) {
    const lod::Hierarchy& h = stores_[0]->hierarchy;
    const std::vector<const lod::Hierarchy*> hierarchies{&h};
    const std::vector<lod::Instance> instances(1);
    const lod::View view = test::fitView(*stores_[0], 200, 150);
    lod::CutScratch scratch;
    lod::Cut cut;
    lod::ResidentPlan plan;
    const std::vector<std::pair<uint32_t, uint32_t>> barred{{0u, 1u}};
    for (const uint64_t budget : {bytesOf(*stores_[0]) / 4, uint64_t{1} << 30}) {
        lod::planResident({hierarchies, instances, {}}, view, {0.25}, budget, {}, scratch, cut, plan);
        EXPECT_EQ(plan.chunks[0][1], 1);
        lod::planResident({hierarchies, instances, {}}, view, {0.25}, budget, barred, scratch, cut, plan);
        EXPECT_EQ(plan.chunks[0][1], 0);
        EXPECT_LE(plan.bytes, budget);
    }
}

}  // namespace
}  // namespace stipple
