// Choosing an error by what frames cost: the fit, the choice, and that a still camera comes to rest (simulated clocks).
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "apps/study/calibration/curve.h"
#include "apps/study/calibration/steady.h"
#include "engine/base/rng.h"

namespace stipple {
namespace {

using namespace study;

double recordsAt(double error) { return 2e6 / (error * error); }

std::vector<CostSample> framesOf(double noise, Rng& rng) {
    std::vector<CostSample> out;
    for (const uint32_t height : {360u, 720u})
        for (const double view : {0.5, 1.0, 3.0})
            for (const double error : {0.5, 1.0, 2.0, 4.0, 8.0}) {
                CostSample s{"surface", height * 16 / 9, height, error, view * recordsAt(error), 0, 0};
                s.ms = (1 + 8e-6 * s.load().pixels + 2e-5 * s.records) * (1 + noise * (2 * rng.uniform() - 1));
                out.push_back(s);
            }
    return out;
}

TEST(Calibration, FindsWhatFramesCostInTheirNoise) {
    Rng rng(7);
    const CostModel exact = fitCost(framesOf(0, rng));
    EXPECT_NEAR(exact.perPixel, 8e-6, 1e-8);
    EXPECT_NEAR(exact.perRecord, 2e-5, 1e-8);
    EXPECT_EQ(exact.perTriangle, 0);
    EXPECT_NEAR(exact.high, 1, 1e-3);
    const CostModel noisy = fitCost(framesOf(0.1, rng));
    EXPECT_NEAR(noisy.perPixel, 8e-6, 1e-6);
    EXPECT_NEAR(noisy.perRecord, 2e-5, 2e-6);
    EXPECT_GT(noisy.high, 1.02);
    EXPECT_LT(noisy.low, 0.98);
    EXPECT_EQ(fitCost({}).msOf({1e6, 1e6, 1e6}), 0);
}

TEST(Calibration, ChoosesTheSmallestErrorThatFits) {
    const CostModel model{1, 8e-6, 2e-5, 0, 1, 1};
    const LoadAt load = [](double error) { return Load{1e6, recordsAt(error), 0}; };
    for (const double ms : {9.5, 12.0, 30.0, 400.0}) {
        const auto error = errorWithin(model, load, ms);
        ASSERT_TRUE(error);
        EXPECT_LE(model.msOf(load(*error)), ms);
        if (*error > kFinestPixels) {
            EXPECT_GT(model.msOf(load(*error * std::exp2(-0.125))), ms) << "one step finer does not";
        }
    }
    EXPECT_FALSE(errorWithin(model, load, 8.9)) << "pixels alone take longer";
}

TEST(Calibration, CurvesComeBackFromTheirFiles) {
    Rng rng(1);
    const Curve curve{"00ff", "cpu", "a processor", "2026-11-24", "1", 2, framesOf(0.1, rng)};
    const std::string text = jsonOfCurve(curve).dump();
    const auto again = curveOf(text, "c.json");
    ASSERT_TRUE(again);
    EXPECT_EQ(jsonOfCurve(*again).dump(), text);
    EXPECT_TRUE(again->of("splat").empty());
    EXPECT_FALSE(curveOf(text.substr(0, text.size() / 2), "c.json"));
    EXPECT_FALSE(curveOf("{\"samples\":[{}]}", "c.json"));
    std::string damaged = text;
    damaged.replace(damaged.find("\"ms\":"), 5, "\"ms\":-");
    EXPECT_FALSE(curveOf(damaged, "c.json"));
}

struct Watched {
    int turns = 0, lastChange = 0;
    double error = 0;
};
/// `frames` of a still camera on a clock with noise; `next` gives the error of the next frame.
Watched watch(double error, int frames, double noise, uint64_t seed,
              const std::function<double(double ms, double error)>& next) {
    Rng rng(seed);
    Watched w;
    int direction = 0;
    for (int f = 0; f < frames; ++f) {
        const double ms = (4 + 2e-5 * recordsAt(error) / 10) * (1 + noise * (2 * rng.uniform() - 1));
        const double then = next(ms, error);
        if (then != error) {
            const int now = then > error ? 1 : -1;
            w.turns += direction != 0 && now != direction ? 1 : 0;
            direction = now;
            w.lastChange = f;
        }
        error = then;
    }
    w.error = error;
    return w;
}

TEST(Steady, AStillCameraComesToRestWhateverTheNoise) {
    for (uint64_t seed = 1; seed <= 50; ++seed)
        for (const double start : {0.3, 1.0, 30.0}) {
            Steady steady(start, 8);
            const Watched w = watch(start, 2'000, 0.2, seed, [&](double ms, double) {
                steady.step(ms, false);
                return steady.error();
            });
            EXPECT_TRUE(steady.isAtRest());
            EXPECT_LE(w.turns, 1);
            EXPECT_LT(w.lastChange, 400);
            const double ms = 4 + 2e-6 * recordsAt(w.error);
            EXPECT_LT(ms, 8 * 1.25) << "beyond the noise";
            EXPECT_GT(ms, start > 10 ? 4.0 : 5.0);
            // The control: what follows every frame never rests.
            const Watched naive =
                watch(start, 2'000, 0.2, seed, [](double took, double error) { return error * std::sqrt(took / 8); });
            EXPECT_GT(naive.turns, 100);
            EXPECT_GT(naive.lastChange, 1'990);
        }
}

TEST(Steady, FollowsAMovingCameraWithinItsDamping) {
    Steady steady(1, 8);
    double worst = 0;
    for (int f = 0; f < 600; ++f) {
        const double heavier = f < 200 ? 1 : f < 400 ? 6 : 0.5;  // into a thicket, and out of it
        const double before = steady.error();
        const double ms = 4 + heavier * 2e-6 * recordsAt(before);
        steady.step(ms, true);
        const double change = steady.error() / before;
        EXPECT_LE(change, std::exp(0.1) + 1e-12);
        EXPECT_GE(change, std::exp(-0.02) - 1e-12);
        EXPECT_FALSE(steady.isAtRest());
        if (f % 200 > 100) worst = std::max(worst, std::abs(ms / 8 - 1));
    }
    EXPECT_LT(worst, 0.06) << "within a hundred frames it is there again";
}

}  // namespace
}  // namespace stipple
