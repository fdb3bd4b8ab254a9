#include "apps/study/plots/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "apps/study/plots/axes.h"
#include "apps/study/plots/svg.h"

namespace stipple::study {
namespace {

constexpr double kWidth = 760, kHeight = 400, kLeft = 64, kRight = 600, kTop = 34, kBottom = 350;

struct Frame {
    Axis x, y;
};

Frame frameOf(const Chart& chart) {
    std::vector<double> xs, ys;
    for (const ChartSeries& s : chart.series)
        for (const ChartPoint& p : s.points) {
            if (!isShown(p.x, chart.xIsLog) || !isShown(p.y, chart.yIsLog)) continue;
            xs.push_back(p.x);
            ys.push_back(p.y);
            if (p.xBand.low < p.xBand.high) xs.insert(xs.end(), {p.xBand.low, p.xBand.high});
        }
    if (chart.hasBound)
        for (const double x : std::vector<double>(xs)) ys.push_back(x + chart.boundOffset);
    return {axisOf(xs, chart.xIsLog, kLeft, kRight), axisOf(ys, chart.yIsLog, kBottom, kTop)};
}

void drawAxes(Svg& svg, const Frame& f, const Chart& chart) {
    for (const double t : f.x.ticks()) {
        svg.line(f.x.at(t), kTop, f.x.at(t), kBottom, "stroke=\"#e4e4e4\"");
        svg.text(f.x.at(t), kBottom + 16, tickText(t), Anchor::middle);
    }
    for (const double t : f.y.ticks()) {
        svg.line(kLeft, f.y.at(t), kRight, f.y.at(t), "stroke=\"#e4e4e4\"");
        svg.text(kLeft - 6, f.y.at(t) + 4, tickText(t), Anchor::end);
    }
    svg.line(kLeft, kBottom, kRight, kBottom, "stroke=\"#444\"");
    svg.line(kLeft, kTop, kLeft, kBottom, "stroke=\"#444\"");
    svg.text(kLeft, 20, chart.title, Anchor::start, "font-weight=\"bold\"");
    svg.text(0.5 * (kLeft + kRight), kBottom + 36, chart.xLabel, Anchor::middle);
    svg.textUp(16, 0.5 * (kTop + kBottom), chart.yLabel);
}

void drawSeries(Svg& svg, const Frame& f, const ChartSeries& s, const std::string& colour) {
    std::vector<std::pair<double, double>> line;
    for (const ChartPoint& p : s.points)
        if (isShown(p.x, f.x.isLog) && isShown(p.y, f.y.isLog)) line.emplace_back(f.x.at(p.x), f.y.at(p.y));
    if (s.isLine && line.size() > 1) svg.polyline(line, fmt::format("stroke=\"{}\" stroke-width=\"1.5\"", colour));
    if (!s.hasMarks) return;
    for (const ChartPoint& p : s.points) {
        if (!isShown(p.x, f.x.isLog) || !isShown(p.y, f.y.isLog)) continue;
        const double x = f.x.at(p.x), y = f.y.at(p.y);
        if (p.xBand.low < p.xBand.high && isShown(p.xBand.low, f.x.isLog))
            svg.line(f.x.at(p.xBand.low), y, f.x.at(p.xBand.high), y,
                     fmt::format("stroke=\"{}\" stroke-width=\"5\" stroke-opacity=\"0.3\"", colour));
        if (p.isMarked) svg.circle(x, y, 6.5, fmt::format("fill=\"none\" stroke=\"{}\"", colour));
        svg.circle(x, y, s.isLine ? 3.5 : 2.5,
                   fmt::format("fill=\"{}\" fill-opacity=\"{}\"", colour, s.isLine ? 1 : 0.6), p.tip);
    }
}

void drawBound(Svg& svg, const Frame& f, const Chart& chart) {
    std::vector<std::pair<double, double>> line;
    for (int k = 0; k <= 60; ++k) {
        const double share = k / 60.0;
        const double x =
            f.x.isLog ? f.x.low * std::pow(f.x.high / f.x.low, share) : f.x.low + share * (f.x.high - f.x.low);
        const double y = x + chart.boundOffset;
        if (isShown(y, f.y.isLog) && y >= f.y.low && y <= f.y.high) line.emplace_back(f.x.at(x), f.y.at(y));
    }
    if (line.size() > 1) svg.polyline(line, "stroke=\"#c00\" stroke-dasharray=\"5 4\"");
}

}  // namespace

std::string colourOf(size_t k) {
    // (Eight of theirs, then lighter and darker ones for passes, which are many.)
    static const std::array<const char*, 16> colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
                                                     "#000000", "#8a8a00", "#9a6324", "#808080", "#a0d8c0", "#f4b59a",
                                                     "#4b0082", "#c5b0d5", "#800000", "#bcbd22"};
    return colours.at(k % colours.size());
}

std::string drawChart(const Chart& chart) {
    Svg svg(kWidth, kHeight, chart.title);
    const Frame f = frameOf(chart);
    drawAxes(svg, f, chart);
    if (chart.hasBound) drawBound(svg, f, chart);
    double y = kTop + 8;
    for (size_t k = 0; k < chart.series.size(); ++k) {
        drawSeries(svg, f, chart.series[k], colourOf(k));
        svg.circle(kRight + 16, y, 4, fmt::format("fill=\"{}\"", colourOf(k)));
        svg.text(kRight + 26, y + 4, chart.series[k].name, Anchor::start);
        y += 18;
    }
    if (!chart.markMeaning.empty()) {
        svg.circle(kRight + 16, y, 6.5, "fill=\"none\" stroke=\"#444\"");
        svg.text(kRight + 26, y + 4, chart.markMeaning, Anchor::start);
        y += 18;
    }
    if (chart.hasBound) {
        svg.line(kRight + 8, y, kRight + 22, y, "stroke=\"#c00\" stroke-dasharray=\"5 4\"");
        svg.text(kRight + 26, y + 4, fmt::format("stated + {} px", shortNumber(chart.boundOffset)), Anchor::start);
    }
    return svg.finish();
}

std::string drawBars(const BarChart& chart) {
    const double height = 90 + 26 * static_cast<double>(chart.bars.size()), bottom = height - 46;
    Svg svg(kWidth, std::max(height, 300.0), chart.title);
    std::vector<double> sums{0};
    std::vector<std::string> names;
    for (const Bar& bar : chart.bars) {
        double sum = 0;
        for (const auto& [name, value] : bar.parts) {
            sum += value;
            if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
        }
        sums.push_back(sum);
    }
    const Axis x = axisOf(sums, false, kLeft + 70, kRight);
    for (const double t : x.ticks()) {
        svg.line(x.at(t), kTop, x.at(t), bottom, "stroke=\"#e4e4e4\"");
        svg.text(x.at(t), bottom + 16, tickText(t), Anchor::middle);
    }
    double y = kTop + 6;
    for (const Bar& bar : chart.bars) {
        svg.text(kLeft + 62, y + 13, bar.name, Anchor::end);
        double from = 0;
        for (const auto& [name, value] : bar.parts) {
            const auto k = static_cast<size_t>(std::find(names.begin(), names.end(), name) - names.begin());
            svg.rect(x.at(from), y, x.at(from + value) - x.at(from), 18, fmt::format("fill=\"{}\"", colourOf(k)),
                     fmt::format("{}: {} ms", name, shortNumber(value)));
            from += value;
        }
        y += 26;
    }
    svg.text(kLeft, 20, chart.title, Anchor::start, "font-weight=\"bold\"");
    svg.text(0.5 * (kLeft + 70 + kRight), bottom + 36, chart.xLabel, Anchor::middle);
    for (size_t k = 0; k < names.size(); ++k) {
        svg.rect(kRight + 12, kTop + 18 * static_cast<double>(k), 10, 10, fmt::format("fill=\"{}\"", colourOf(k)));
        svg.text(kRight + 28, kTop + 9 + 18 * static_cast<double>(k), names[k], Anchor::start);
    }
    return svg.finish();
}

}  // namespace stipple::study
