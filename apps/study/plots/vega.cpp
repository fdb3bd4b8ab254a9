#include "apps/study/plots/vega.h"

#include <cmath>

#include "apps/study/plots/axes.h"

namespace stipple::study {
namespace {

using nlohmann::json;
constexpr const char* kSchema = "https://vega.github.io/schema/vega-lite/v5.json";

json scaleOf(bool isLog) { return isLog ? json{{"type", "log"}} : json{{"zero", false}}; }

}  // namespace

json vegaOf(const Chart& chart) {
    json values = json::array();
    bool isLine = false;
    for (const ChartSeries& s : chart.series) {
        isLine = isLine || s.isLine;
        for (const ChartPoint& p : s.points) {
            if (!isShown(p.x, chart.xIsLog) || !isShown(p.y, chart.yIsLog)) continue;
            json v = {{"series", s.name}, {"x", p.x}, {"y", p.y}, {"marked", p.isMarked}, {"tip", p.tip}};
            if (p.xBand.low < p.xBand.high) {
                v["low"] = p.xBand.low;
                v["high"] = p.xBand.high;
            }
            values.push_back(v);
        }
    }
    const json x = {
        {"field", "x"}, {"type", "quantitative"}, {"title", chart.xLabel}, {"scale", scaleOf(chart.xIsLog)}};
    const json y = {
        {"field", "y"}, {"type", "quantitative"}, {"title", chart.yLabel}, {"scale", scaleOf(chart.yIsLog)}};
    json layers = json::array();
    const json colour = {{"field", "series"}, {"type", "nominal"}};
    if (isLine) layers.push_back({{"mark", {{"type", "line"}}}, {"encoding", {{"x", x}, {"y", y}, {"color", colour}}}});
    layers.push_back({{"mark", {{"type", "rule"}, {"opacity", 0.3}, {"strokeWidth", 5}}},
                      {"transform", json::array({{{"filter", "isValid(datum.low)"}}})},
                      {"encoding",
                       {{"x", {{"field", "low"}, {"type", "quantitative"}, {"scale", scaleOf(chart.xIsLog)}}},
                        {"x2", {{"field", "high"}}},
                        {"y", y},
                        {"color", colour}}}});
    layers.push_back(
        {{"mark", {{"type", "point"}, {"filled", true}}},
         {"encoding", {{"x", x}, {"y", y}, {"color", colour}, {"tooltip", {{"field", "tip"}, {"type", "nominal"}}}}}});
    return {{"$schema", kSchema}, {"title", chart.title}, {"data", {{"values", values}}}, {"layer", layers}};
}

json vegaOf(const BarChart& chart) {
    json values = json::array();
    for (const Bar& bar : chart.bars)
        for (const auto& [name, value] : bar.parts)
            values.push_back({{"bar", bar.name}, {"part", name}, {"value", value}});
    return {{"$schema", kSchema},
            {"title", chart.title},
            {"data", {{"values", values}}},
            {"mark", "bar"},
            {"encoding",
             {{"x", {{"field", "value"}, {"type", "quantitative"}, {"title", chart.xLabel}}},
              {"y", {{"field", "bar"}, {"type", "nominal"}, {"title", nullptr}}},
              {"color", {{"field", "part"}, {"type", "nominal"}}}}}};
}

}  // namespace stipple::study
