// Two series that were measured in turn: is one slower, and by how much? They are visits of the same cameras in the
// same blocks, in pairs; each pair gives one ratio of medians, so that like is compared with like. Which of a pair came
// first is chance, so that logarithms of ratios lie as often above their middle as below it, whatever else the machine
// did: the interval of signed ranks (Wilcoxon 1945; Hodges & Lehmann 1963) needs that alone, and a visit that something
// else disturbed moves it by one rank, not by its size.
#pragma once

#include <cstddef>

#include "apps/study/statistics/intervals.h"

namespace stipple::study {

/// Frame times, ms, by visit of a camera in a block.
using Visits = Blocks;

/// Of times: an alarm is an interval of this confidence that lies wholly outside of 1 +- kAlarmShare.
inline constexpr double kAlarmConfidence = 0.999, kAlarmShare = 0.01;
/// Of errors in pixels, which no chance is in: more than this is an alarm.
inline constexpr double kAlarmPixels = 0.05;

/// The median of averages of all pairs (Walsh averages), and their interval: exact for up to kExactRanks values, by the
/// normal distribution of the sum of ranks above. Where there are too few values for the confidence (11 for 0.999, 6
/// for 0.95) the interval is all numbers.
inline constexpr size_t kExactRanks = 150;
Interval signedRankInterval(const std::vector<double>& values, double confidence);

/// Median of each visit of `after` over that of the same one of `before`. Visits that only one has are left out.
Interval ratioOf(const Visits& before, const Visits& after, double confidence);

bool isAlarm(const Interval& ratio);
/// Neither can be called the faster one.
inline bool areAlike(const Interval& ratio) { return ratio.low <= 1 && ratio.high >= 1; }

}  // namespace stipple::study
