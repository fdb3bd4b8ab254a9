// What is said of times, on series that were recorded once: no clock is read here.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "apps/study/statistics/compare.h"
#include "engine/base/rng.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using study::Blocks;
using study::Interval;
using study::Visits;

/// Visits that 2 % need on the machine of the record, where something else was busy, too.
constexpr size_t kEnough = 300;

TEST(StudyStatistics, QuantilesLieBetweenRanks) {
    EXPECT_EQ(study::quantile({3, 1, 2}, 0.5), 2);
    EXPECT_EQ(study::quantile({4, 1, 2, 3}, 0.5), 2.5);
    EXPECT_EQ(study::quantile({4, 1, 2, 3}, 0), 1);
    EXPECT_EQ(study::quantile({4, 1, 2, 3}, 1), 4);
    EXPECT_NEAR(study::quantile({10, 20, 30, 40, 50}, 0.9), 46, 1e-12);
    EXPECT_TRUE(std::isnan(study::quantile({}, 0.5)));
}

// Wilcoxon's table: of 6 values the 95 % interval (0.969) is from the least to the greatest; of 10 (two-sided 0.05) the
// 9th Walsh average from either end; of 10 values nothing is sure by 0.999, of 11 all of them span it.
TEST(StudyStatistics, SignedRanksHaveTheExactIntervalsOfTheTable) {
    EXPECT_EQ(study::signedRankInterval({1, 2, 4, 8, 16, 32}, 0.95).low, 1);
    EXPECT_EQ(study::signedRankInterval({1, 2, 4, 8, 16, 32}, 0.95).high, 32);
    EXPECT_TRUE(std::isinf(study::signedRankInterval({1, 2, 4, 8, 16}, 0.95).high));
    std::vector<double> values;
    for (int i = 0; i < 10; ++i) values.push_back(std::exp2(i));
    std::vector<double> averages;
    for (size_t i = 0; i < 10; ++i)
        for (size_t k = i; k < 10; ++k) averages.push_back(0.5 * (values[i] + values[k]));
    std::sort(averages.begin(), averages.end());
    const Interval ten = study::signedRankInterval(values, 0.95);
    EXPECT_EQ(ten.low, averages[8]) << "W of 8 has a chance of 0.0244";
    EXPECT_EQ(ten.high, averages[averages.size() - 9]);
    EXPECT_TRUE(std::isinf(study::signedRankInterval(values, 0.999).low));
    values.push_back(2048);
    EXPECT_EQ(study::signedRankInterval(values, 0.999).low, 1);
}

// Of chance that is known: 95 % intervals hold the truth in about 95 of 100, and the seed decides all.
TEST(StudyStatistics, IntervalsHoldTheTruthAsOftenAsTheySay) {
    Rng rng(5);
    int held = 0, bootstrapped = 0;
    for (int run = 0; run < 400; ++run) {
        std::vector<double> logs;
        Blocks blocks;
        for (int b = 0; b < 20; ++b) {
            const double drift = 0.1 * rng.normal();
            logs.push_back(0.3 + drift);
            blocks.push_back({});
            for (int f = 0; f < 5; ++f) blocks.back().push_back(10 + 10 * drift + 0.2 * rng.normal());
        }
        const Interval i = study::signedRankInterval(logs, 0.95);
        held += i.low <= 0.3 && 0.3 <= i.high;
        const Interval m = study::bootstrapQuantile(blocks, 0.5, 0.95, 9, 200);
        bootstrapped += m.low <= 10 && 10 <= m.high;
        if (run == 0) EXPECT_EQ(m.low, study::bootstrapQuantile(blocks, 0.5, 0.95, 9, 200).low);
    }
    EXPECT_GE(held, 368);
    EXPECT_LE(held, 396);
    EXPECT_GE(bootstrapped, 352) << "a bootstrap of 20 blocks is a little too narrow";
}

/// Two series of the same frames: visits of four frames.
std::array<Visits, 2> recorded() {
    std::istringstream lines(test::slurp(std::string(STIPPLE_SOURCE_DIR) + "/tests/study/recorded_frames.csv"));
    std::string line;
    std::getline(lines, line);
    std::array<Visits, 2> series;
    while (std::getline(lines, line)) {
        std::istringstream cells(line);
        std::vector<double> values;
        for (std::string cell; std::getline(cells, cell, ',');) values.push_back(std::stod(cell));
        for (size_t i = 0; i < values.size(); i += 4)
            series.at(2 * i / values.size()).push_back({values[i], values[i + 1], values[i + 2], values[i + 3]});
    }
    return series;
}

/// `count` of the recorded visits, any of them, and which of each pair is called the first is chance, too; all of the
/// second series `factor` times as long.
std::array<Visits, 2> drawnFrom(const std::array<Visits, 2>& all, size_t count, double factor, Rng& rng) {
    std::array<Visits, 2> out;
    std::vector<size_t> left(all[0].size());
    for (size_t i = 0; i < left.size(); ++i) left[i] = i;
    while (out[0].size() < count) {
        const size_t k = rng.below(left.size()), b = left[k];
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(k));
        const size_t first = rng.below(2);
        out[0].push_back(all.at(first)[b]);
        out[1].push_back(all.at(1 - first)[b]);
        for (double& ms : out[1].back()) ms *= factor;
    }
    return out;
}

bool alarms(const std::array<Visits, 2>& series) {
    return study::isAlarm(study::ratioOf(series[0], series[1], study::kAlarmConfidence));
}

TEST(StudyStatistics, TheSameFramesAlarmAtMostOnceInAHundred) {
    const auto all = recorded();
    ASSERT_EQ(all[0].size(), 1600u);
    ASSERT_EQ(all[1].size(), 1600u);
    for (const size_t visits : {12, 24, 100, 300}) {
        Rng rng(visits);
        int alarmed = 0;
        for (int run = 0; run < 500; ++run) alarmed += alarms(drawnFrom(all, visits, 1, rng));
        std::printf("%zu visits: %d of 500 A/A series alarm\n", visits, alarmed);
        EXPECT_LE(alarmed, 5) << visits;
    }
    // The control: without the interval, by medians alone, many do.
    Rng rng(1);
    int careless = 0;
    for (int run = 0; run < 500; ++run) {
        const auto series = drawnFrom(all, 12, 1, rng);
        const double ratio =
            study::quantile(study::pooled(series[1]), 0.5) / study::quantile(study::pooled(series[0]), 0.5);
        careless += std::abs(ratio - 1) > study::kAlarmShare;
    }
    EXPECT_GT(careless, 25);
}

TEST(StudyStatistics, ASlowDownOfTwoPercentIsFound) {
    const auto all = recorded();
    Rng rng(2);
    int slower = 0, faster = 0, small = 0;
    for (int run = 0; run < 100; ++run) {
        slower += alarms(drawnFrom(all, kEnough, 1.02, rng));
        faster += alarms(drawnFrom(all, kEnough, 1 / 1.02, rng));
        small += alarms(drawnFrom(all, kEnough, 1.005, rng));
    }
    std::printf("of 100 series: %d found 2 %% slower, %d faster; %d alarm at 0.5 %%\n", slower, faster, small);
    EXPECT_GE(slower, 95);
    EXPECT_GE(faster, 95);
    EXPECT_LE(small, 1) << "half a percent is no alarm";
}

}  // namespace
}  // namespace stipple
