// What a study writes: rows.csv (one row a frame), study.json, plots (SVG and Vega-Lite), report.html, which needs
// nothing beside it.
#pragma once

#include <nlohmann/json.hpp>

#include "apps/study/plots/chart.h"
#include "apps/study/sweep/tables.h"

namespace stipple::study {

std::string rowsCsv(const std::vector<StudyScene>& scenes, const StudyResult& result);
nlohmann::json jsonOfStudy(const std::vector<StudyScene>& scenes, const StudyResult& result,
                           const std::vector<Summary>& all);
/// A sentence.
std::string describeKept(const KeptAudit& kept);
/// For a terminal.
std::string describeStudy(const std::vector<StudyScene>& scenes, const StudyResult& result,
                          const std::vector<Summary>& all);

/// Of one scene at one size.
std::vector<Chart> chartsOf(const Panel& panel, const std::vector<const Summary*>& budgets, const StudyResult& result,
                            const std::string& name);
BarChart passesOf(const Panel& panel, const StudyResult& result, const std::string& name);

/// `crop`: the bytes of a PNG of the folder; empty: it is not there.
std::string htmlOf(const std::vector<StudyScene>& scenes, const StudyResult& result, const std::vector<Summary>& all,
                   const std::function<std::string(uint32_t cell)>& crop);

/// All of it, into the folder.
Result<void> writeStudy(const std::vector<StudyScene>& scenes, const StudyResult& result,
                        const std::vector<Summary>& all);

}  // namespace stipple::study
