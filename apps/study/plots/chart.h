// Charts: values in, SVG out.
#pragma once

#include <string>
#include <vector>

#include "apps/study/statistics/intervals.h"

namespace stipple::study {

struct ChartPoint {
    double x = 0, y = 0;
    Interval xBand{};  ///< drawn where its low is below its high
    std::string tip;   ///< when the mouse rests on it
    bool isMarked = false;
};
struct ChartSeries {
    std::string name;
    std::vector<ChartPoint> points;
    bool isLine = true, hasMarks = true;
};
struct Chart {
    std::string name;  ///< of its files
    std::string title, xLabel, yLabel;
    bool xIsLog = false, yIsLog = false;
    std::vector<ChartSeries> series;
    bool hasBound = false;  ///< the line y = x + boundOffset, above which a statement does not hold
    double boundOffset = 0;
    std::string markMeaning;  ///< what marked points are; empty: none is
};
std::string drawChart(const Chart& chart);

struct Bar {
    std::string name;
    std::vector<std::pair<std::string, double>> parts;
};
struct BarChart {
    std::string name, title, xLabel;
    std::vector<Bar> bars;
};
/// Lying bars of stacked parts.
std::string drawBars(const BarChart& chart);

/// Of the k-th series: told apart also by who sees colours otherwise (Okabe & Ito 2008).
std::string colourOf(size_t k);

}  // namespace stipple::study
