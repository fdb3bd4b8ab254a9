// The bound audit of what wind moves and of borders of shadows: over scenes, modes, cameras and times, by what the full
// detail has there. Violations are counted, and are none where a kind is exact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "apps/study/audit/audit.h"
#include "apps/study/audit/moved.h"
#include "engine/cpu/cpu_backend.h"
#include "engine/reference/reference.h"
#include "tests/support/drawn_shapes.h"
#include "tests/support/forests.h"

namespace stipple {
namespace {

using glm::dvec3;

/// A tree somewhere, drawn at times of an animation.
class WindAudit : public testing::Test {
  protected:
    struct Sum {
        uint64_t drawn = 0, beyond = 0, displaced = 0;
        double worst = 0, p99 = 0, stated = 0, farthest = 0;  ///< px
    };
    static constexpr dvec3 kUp{0, 1, 0}, kTowards{1, 0, 0};

    void SetUp() override {
        placed_.store = test::buildCurves(test::oak(6'000), folder_ / "oak.stipple", *executor_, 256);
        placed_.place.translation = {0.5, 0, -0.25};
        const auto leaves = study::leavesOf(std::span(&placed_, 1), 10'000'000);
        ASSERT_TRUE(leaves) << leaves.error().line();
        leaves_ = *leaves;
        ASSERT_GT(leaves_.tubes.size(), 10'000u);
    }
    /// Frames over a path of cameras and of times. `judgedBy`: share of the wind by which the full detail moves;
    /// `held`: share of what is stated that is allowed.
    Sum audit(double strength, render::Mode mode, double tau, double judgedBy = 1, double held = 1) {
        Sum sum;
        const auto backend = cpu::makeCpuBackend(*executor_);
        const auto state = render::makeFrameState(std::vector{placed_}, *backend, *executor_, {});
        render::FrameSettings settings = test::drawnAs(mode, tau);
        settings.draw.worldUp = kUp;
        int number = 0;
        for (const auto& [elevation, distance] : {std::pair{20.0, 0.8}, {35.0, 2.0}, {5.0, 5.0}, {15.0, 12.0}})
            for (const double seconds : {0.4, 86'402.9}) {
                lod::View view = test::lookAt(*placed_.store, 40.0 * number++, elevation, distance, 200);
                view.eye += placed_.place.translation;
                settings.draw.wind = {strength, seconds, kTowards};
                render::setSway(settings.draw.wind, state->hierarchies, state->instances, state->groups);
                EXPECT_TRUE(render::renderUntilComplete(*state, view, settings).value_or(false));
                const study::Sway sway = study::swayOf(placed_, kUp, kTowards, judgedBy * strength, seconds);
                const study::FullDetail full(study::moved(leaves_, sway));
                sum.stated = std::max(sum.stated, state->counters.tauEffectivePixels);
                const study::Audit a = study::auditDepths(state->image, state->image, view, full,
                                                          held * state->counters.tauEffectivePixels, *executor_);
                sum.drawn += a.drawn;
                sum.beyond += a.beyond();
                sum.worst = std::max(sum.worst, a.worst);
                sum.p99 = std::max(sum.p99, a.p99);
                const double pixel =
                    distance *
                    glm::length(placed_.store->description.boundsMax - placed_.store->description.boundsMin) /
                    view.focalPixels;
                sum.farthest = std::max(sum.farthest, sway.most * study::farthestMoved(leaves_, sway) / pixel);
            }
        return sum;
    }

    test::TempFolder folder_;
    std::unique_ptr<Executor> executor_ = makeTbbExecutor(2);
    render::PlacedStore placed_;
    study::FullShapes leaves_;
};

TEST_F(WindAudit, NothingMovesFartherThanSpheresGrow) {
    double farthest = 0;
    for (const double strength : {0.03, 0.5}) {
        const auto backend = cpu::makeCpuBackend(*executor_);
        const auto state = render::makeFrameState(std::vector{placed_}, *backend, *executor_, {});
        render::setSway({strength, 0, kTowards}, state->hierarchies, state->instances, state->groups);
        for (int k = 0; k < 200; ++k) {
            const study::Sway sway = study::swayOf(placed_, kUp, kTowards, strength, 0.37 * k);
            EXPECT_NEAR(state->instances[0].sway, sway.most, 1e-9 * sway.most);
            const double moved = study::farthestMoved(leaves_, sway);
            EXPECT_LE(moved, 1 + 1e-9);
            farthest = std::max(farthest, moved);
        }
    }
    std::printf("places moved by up to %.3f of what spheres grow by\n", farthest);
    EXPECT_GT(farthest, 0.5) << "the control: half of it would not hold";
}

TEST_F(WindAudit, PicturesOfBentTreesKeepTheirBoundFromTheBentLeaves) {
    for (const double strength : {0.03, 0.2, 0.5})
        for (const render::Mode mode : {render::Mode::surface, render::Mode::points})
            for (const double tau : {0.5, 1.0, 4.0}) {
                const Sum a = audit(strength, mode, tau);
                std::printf(
                    "wind %.2f, %s at %.1f px: moved by up to %.1f px; %lu drawn, %lu beyond, p99 %.2f, worst "
                    "%.2f px of %.2f and a half\n",
                    strength, render::reconstructionOf(mode).name, tau, a.farthest, static_cast<unsigned long>(a.drawn),
                    static_cast<unsigned long>(a.beyond), a.p99, a.worst, a.stated);
                EXPECT_GT(a.drawn, 10'000u);
                EXPECT_EQ(a.beyond, 0u) << strength << " " << render::reconstructionOf(mode).name << " " << tau;
            }
    const Sum half = audit(0.2, render::Mode::surface, 1, 0.5);
    EXPECT_GT(half.beyond, 1'000u) << "the control: leaves in half of the wind";
    const Sum less = audit(0.03, render::Mode::surface, 4, 1, 0.1);
    std::printf("in half of the wind %lu beyond; by a tenth of what is stated %lu\n",
                static_cast<unsigned long>(half.beyond), static_cast<unsigned long>(less.beyond));
    EXPECT_GT(less.beyond, 20u) << "the control: a tenth of what is stated";
}

}  // namespace
}  // namespace stipple
