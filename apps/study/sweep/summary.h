// Cells of one configuration (scene, size, mode, error asked for) over all cameras: what a table has one row of.
#pragma once

#include "apps/study/statistics/compare.h"
#include "apps/study/sweep/runner.h"

namespace stipple::study {

inline constexpr double kBandConfidence = 0.95;

struct Summary {
    Cell of;            ///< its view is of no meaning
    CellErrors errors;  ///< dB of the mean square; counts of all; px, depth and stated: the greatest; others: means
    Blocks blocks;      ///< ms of all frames, by block
    Visits visits;      ///< the same by block and camera
    Interval ms;        ///< median and its band
    Interval p95, p99;  ///< of frames, with theirs
    std::vector<std::pair<std::string, double>> passes;  ///< ms a frame on average over cameras, of medians
    uint32_t worst = ~0u;  ///< the cell with a crop whose foreground is farthest from the truth; ~0: none has one
};
/// In the order of the plan.
std::vector<Summary> summarise(const StudyResult& result);
/// Of what lies together: one scene at one size, without budgets.
std::vector<std::vector<const Summary*>> panelsOf(const std::vector<Summary>& all);
/// Of one scene at one size what was drawn within budgets of records, from the smallest on.
std::vector<const Summary*> budgetsOf(const std::vector<Summary>& all, uint32_t scene, uint32_t size);

}  // namespace stipple::study
