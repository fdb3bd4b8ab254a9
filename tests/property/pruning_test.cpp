// What of curves is stochastic is stated beside the error, by its share of the area that is seen.
#include <gtest/gtest.h>

#include "engine/cpu/cpu_backend.h"
#include "engine/render/pruning.h"
#include "lod/store/pruning.h"
#include "tests/support/curves.h"

namespace stipple {
namespace {

class Pruning : public testing::Test {
  protected:
    render::PrunedShares prunedOf(const lod::CurveSet& set, const lod::View& view, double tau,
                                  uint32_t leafSegments = 256) {
        store_ = test::buildCurves(set, folder_ / "a.stipple", *executor_, leafSegments);
        const auto backend = cpu::makeCpuBackend(*executor_);
        auto state = render::makeFrameState({store_}, *backend, *executor_, {});
        render::FrameSettings settings;
        settings.budgets.errorPixels = tau;
        EXPECT_TRUE(render::renderUntilComplete(*state, view, settings));
        const auto pruned = render::measurePruning(*state, view);
        EXPECT_TRUE(pruned);
        state->streamer.reset();
        return pruned ? *pruned : render::PrunedShares{};
    }
    /// Along z, at a distance at which a world unit is 100 pixels.
    static lod::View straightAt() {
        lod::View view;
        view.eye = {0, 0, 10};
        view.right = {1, 0, 0};
        view.down = {0, -1, 0};
        view.forward = {0, 0, -1};
        view.focalPixels = 1000;
        view.width = view.height = 640;
        return view;
    }
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(0);
    test::TempFolder folder_;
    std::shared_ptr<const lod::Store> store_;
};

TEST_F(Pruning, NarrowCurvesAreCountedByTheirAreaAndWideOnesAreNot) {
    // Lines across the picture: one of 0.4 pixels, one of 3; and one behind the eye and one beside it.
    lod::CurveSet set;
    const auto add = [&](double y, double z, float radius) {
        for (const double x : {-2.0, 2.0}) {
            set.position.push_back({x, y, z});
            set.radius.push_back(radius);
            set.normal.push_back(glm::vec3(0));
            set.colour.push_back(0xffffff);
        }
        set.first.push_back(static_cast<uint32_t>(set.position.size()));
        set.isRibbon.push_back(0);
    };
    add(0.5, 0, 0.002f);
    add(-0.5, 0, 0.015f);
    add(0, 20, 0.002f);
    add(30, 0, 0.002f);
    const render::PrunedShares pruned = prunedOf(set, straightAt(), 0.01);
    EXPECT_NEAR(pruned.curveArea, 400 * (0.4 + 3), 0.02 * 400 * 3.4);
    EXPECT_NEAR(pruned.narrowShare(), 0.4 / 3.4, 0.01);
    EXPECT_EQ(pruned.thinnedArea, 0);
    EXPECT_EQ(pruned.discs, 0u);
}

TEST_F(Pruning, ARibbonIsAsWideAsItIsSeen) {
    for (const double degrees : {0.0, 85.0}) {  // 2 pixels wide from the front, 0.17 from the side
        const double a = degrees * M_PI / 180;
        const glm::vec3 n(0, std::sin(a), std::cos(a));
        const lod::CurveSet set = test::oneCurve({{-1, 0, 0}, {1, 0, 0}}, 0.01f, {n, n});
        const render::PrunedShares pruned = prunedOf(set, straightAt(), 0.01);
        EXPECT_NEAR(pruned.curveArea, 200 * 2 * std::cos(a), 0.05 * 400 * std::cos(a) + 1) << degrees;
        EXPECT_EQ(pruned.narrowShare(), degrees > 80 ? 1 : 0) << degrees;
    }
}

TEST_F(Pruning, CurvesThatStandForOthersAreCounted) {
    test::CurlRecipe recipe;
    recipe.count = 3000;
    recipe.radius = 0.004f;
    recipe.ribbons = 0;
    lod::View view = straightAt();
    view.focalPixels = 4000;  // 1.6 pixels of half-width: nothing is narrow
    const lod::CurveSet set = test::curls(recipe);
    const render::PrunedShares fine = prunedOf(set, view, 0.01, 64);
    EXPECT_EQ(fine.thinnedArea, 0) << "all of them are drawn";
    const render::PrunedShares coarse = prunedOf(set, view, 60, 64);
    EXPECT_GT(coarse.thinnedShare() + coarse.narrowShare(), 0.5);
    EXPECT_GT(coarse.thinnedArea, 0);
    EXPECT_LT(lod::keptShare(store_->hierarchy.nodes[0]), 0.5);
    EXPECT_GT(lod::keptShare(store_->hierarchy.nodes[0]), 0);
    for (const lod::Node& n : store_->hierarchy.nodes)
        if (n.isLeaf()) EXPECT_EQ(lod::keptShare(n), 1);
}

}  // namespace
}  // namespace stipple
