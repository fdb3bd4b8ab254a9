// The charts of one scene at one size.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "apps/study/mode_name.h"
#include "apps/study/plots/svg.h"
#include "apps/study/sweep/report.h"

namespace stipple::study {
namespace {

std::string tipOf(const Summary& s) {
    return fmt::format("{}, {} px asked for: {} ms ({} to {}), {} dB, {} px at p99", nameOf(s.of.mode),
                       shortNumber(s.of.target), shortNumber(s.ms.middle), shortNumber(s.ms.low),
                       shortNumber(s.ms.high), shortNumber(s.errors.psnrForeground), shortNumber(s.errors.lodP99));
}

/// A line a mode, from the finest to the coarsest.
Chart overModes(const Panel& panel, Chart chart, const std::function<ChartPoint(const Summary&)>& pointOf) {
    const std::vector<bool> isFront = chart.markMeaning.empty() ? std::vector<bool>() : frontOf(panel);
    for (size_t i = 0; i < panel.size(); ++i) {
        if (chart.series.empty() || chart.series.back().name != nameOf(panel[i]->of.mode))
            chart.series.push_back({nameOf(panel[i]->of.mode), {}});
        ChartPoint p = pointOf(*panel[i]);
        p.tip = tipOf(*panel[i]);
        p.isMarked = !isFront.empty() && isFront[i];
        chart.series.back().points.push_back(p);
    }
    return chart;
}

/// Measured over stated, one point a cell.
Chart bounds(const Panel& panel, const StudyResult& result, const std::string& name) {
    Chart chart{name + "-bounds",
                "Measured against stated error, every view",
                "stated, px",
                "farthest pixel, px",
                true,
                true,
                {},
                true,
                kSamplePixels,
                ""};
    for (uint32_t c = 0; c < result.cells.size(); ++c) {
        const Cell& cell = result.cells[c];
        if (cell.scene != panel.front()->of.scene || cell.size != panel.front()->of.size) continue;
        auto at = std::find_if(chart.series.begin(), chart.series.end(),
                               [&](const ChartSeries& s) { return s.name == nameOf(cell.mode); });
        if (at == chart.series.end()) at = chart.series.insert(at, ChartSeries{nameOf(cell.mode), {}, false, true});
        at->points.push_back({result.errors[c].stated, result.errors[c].lodMost, {}, fmt::format("cell {}", c), false});
    }
    return chart;
}

/// Shares of frames that are done by a time, at the error that crops are of.
Chart frameTimes(const Panel& panel, const StudyResult& result, const std::string& name) {
    Chart chart{name + "-frames",
                fmt::format("Frame times at {} px", shortNumber(cropTarget(result.settings))),
                "ms",
                "share of frames done",
                true,
                false,
                {},
                false,
                0,
                ""};
    for (const Summary* s : panel) {
        if (s->of.target != cropTarget(result.settings)) continue;
        std::vector<double> all = pooled(s->blocks);
        std::sort(all.begin(), all.end());
        ChartSeries series{nameOf(s->of.mode), {}, true, false};
        const size_t stride = std::max<size_t>(1, all.size() / 200);
        for (size_t i = 0; i < all.size(); i += stride)
            series.points.push_back(
                {all[i], static_cast<double>(i + 1) / static_cast<double>(all.size()), {}, "", false});
        chart.series.push_back(std::move(series));
    }
    return chart;
}

/// What a budget of records leaves of the error that was asked for.
Chart budgetChart(const std::vector<const Summary*>& budgets, const std::string& name) {
    Chart chart{name + "-budgets",
                "Errors within budgets of records",
                "records drawn at most",
                "px",
                true,
                true,
                {{"stated", {}}, {"measured, p99", {}}},
                false,
                0,
                ""};
    for (const Summary* s : budgets) {
        const auto records = static_cast<double>(s->of.records);
        chart.series[0].points.push_back({records, s->errors.stated, {}, tipOf(*s), false});
        chart.series[1].points.push_back({records, s->errors.lodP99, {}, tipOf(*s), false});
    }
    return chart;
}

}  // namespace

std::vector<Chart> chartsOf(const Panel& panel, const std::vector<const Summary*>& budgets, const StudyResult& result,
                            const std::string& name) {
    std::vector<Chart> charts;
    charts.push_back(overModes(panel,
                               {name + "-error-ms",
                                "Distance from the traced truth against time",
                                "ms a frame (median, 95 % band)",
                                "PSNR of the foreground, dB",
                                true,
                                false,
                                {},
                                false,
                                0,
                                "Pareto front"},
                               [](const Summary& s) {
                                   return ChartPoint{s.ms.middle, s.errors.psnrForeground, s.ms, "", false};
                               }));
    charts.push_back(overModes(panel,
                               {name + "-flip-ms",
                                "What is seen of the difference (FLIP) against time",
                                "ms a frame (median, 95 % band)",
                                "mean FLIP",
                                true,
                                true,
                                {},
                                false,
                                0,
                                ""},
                               [](const Summary& s) {
                                   return ChartPoint{s.ms.middle, s.errors.flipMean, s.ms, "", false};
                               }));
    charts.push_back(overModes(panel,
                               {name + "-detail-ms",
                                "Distance from the full detail against time",
                                "ms a frame (median, 95 % band)",
                                "px, 99 % of the pixels are nearer",
                                true,
                                true,
                                {},
                                false,
                                0,
                                ""},
                               [](const Summary& s) {
                                   return ChartPoint{s.ms.middle, s.errors.lodP99, s.ms, "", false};
                               }));
    charts.push_back(bounds(panel, result, name));
    charts.push_back(overModes(panel,
                               {name + "-error-bytes",
                                "Distance from the traced truth against bytes",
                                "MB of the file that a frame needs, at most",
                                "PSNR of the foreground, dB",
                                true,
                                false,
                                {},
                                false,
                                0,
                                ""},
                               [](const Summary& s) {
                                   return ChartPoint{s.errors.bytes / 1e6, s.errors.psnrForeground, {}, "", false};
                               }));
    charts.push_back(frameTimes(panel, result, name));
    if (!budgets.empty()) charts.push_back(budgetChart(budgets, name));
    if (panel.front()->of.size == 0)
        for (Chart& chart : arrivalCharts(result.arrivals, panel.front()->of.scene, name))
            if (!chart.series.empty()) charts.push_back(std::move(chart));
    return charts;
}

BarChart passesOf(const Panel& panel, const StudyResult& result, const std::string& name) {
    BarChart chart{name + "-passes",
                   fmt::format("Milliseconds by pass at {} px", shortNumber(cropTarget(result.settings))),
                   "ms a frame (mean over cameras of medians)",
                   {}};
    for (const Summary* s : panel)
        if (s->of.target == cropTarget(result.settings)) chart.bars.push_back({nameOf(s->of.mode), s->passes});
    return chart;
}

}  // namespace stipple::study
