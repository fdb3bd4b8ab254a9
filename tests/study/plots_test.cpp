// Charts: the same bytes, well formed, values where they belong.
#include <gtest/gtest.h>

#include <cmath>

#include "apps/study/plots/axes.h"
#include "apps/study/plots/chart.h"
#include "apps/study/plots/svg.h"
#include "apps/study/plots/vega.h"

namespace stipple {
namespace {

study::Chart sample() {
    study::Chart chart{"a", "Errors & <times>", "ms", "dB", true, false, {}, true, 0.5, "best"};
    chart.series.push_back({"one", {{1, 20, {0.9, 1, 1.2}, "tip \"1\"", true}, {10, 30, {}, "", false}}});
    chart.series.push_back(
        {"two", {{NAN, 20, {}, "", false}, {-1, 25, {}, "", false}, {100, INFINITY, {}, "", false}}});
    return chart;
}

size_t countOf(const std::string& text, const std::string& what) {
    size_t count = 0;
    for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
    return count;
}

/// Every element that begins ends, inside the one that it begins in.
bool isWellFormed(const std::string& xml) {
    std::vector<std::string> open;
    for (size_t at = xml.find('<'); at != std::string::npos; at = xml.find('<', at + 1)) {
        const size_t end = xml.find('>', at);
        if (end == std::string::npos) return false;
        const std::string tag = xml.substr(at + 1, end - at - 1);
        if (tag.find('<') != std::string::npos || countOf(tag, "\"") % 2 != 0) return false;
        if (tag.front() == '/') {
            if (open.empty() || open.back() != tag.substr(1)) return false;
            open.pop_back();
        } else if (tag.back() != '/') {
            open.push_back(tag.substr(0, tag.find(' ')));
        }
    }
    return open.empty();
}

/// Of the last rectangle before a tip.
double widthBefore(const std::string& svg, const std::string& tip) {
    const size_t at = svg.rfind("width=\"", svg.find(tip));
    return std::stod(svg.substr(at + 7));
}

TEST(StudyPlots, AxesHoldTheirValuesAndTicks) {
    const study::Axis log = study::axisOf({0.5, 20, -3, NAN}, true, 0, 100);
    EXPECT_GT(log.at(0.5), 0);
    EXPECT_LT(log.at(20), 100);
    EXPECT_NEAR(log.at(std::sqrt(0.5 * 20)), 50, 1e-9) << "the middle of decades";
    EXPECT_EQ(log.ticks(), (std::vector<double>{0.5, 1, 2, 5, 10, 20}));
    const study::Axis line = study::axisOf({10, 20}, false, 100, 0);
    EXPECT_LT(line.at(20), line.at(10)) << "upwards";
    for (const double t : line.ticks()) {
        EXPECT_GE(t, line.low);
        EXPECT_LE(t, line.high);
    }
    EXPECT_EQ(study::axisOf({}, true, 0, 1).low, 1);
    EXPECT_LT(study::axisOf({7}, false, 0, 1).low, 7) << "one value has room on either side";
}

TEST(StudyPlots, AreTheSameBytesAndWellFormed) {
    const std::string svg = study::drawChart(sample());
    EXPECT_EQ(svg, study::drawChart(sample()));
    EXPECT_TRUE(isWellFormed(svg));
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_EQ(svg.find("inf"), std::string::npos);
    EXPECT_EQ(countOf(svg, "r=\"3.5\""), 2u) << "what cannot be shown is left out";
    EXPECT_EQ(countOf(svg, "<title>tip &quot;1&quot;</title>"), 1u);
    const std::string bars =
        study::drawBars({"b", "Passes", "ms", {{"one", {{"cut", 1}, {"draw", 3}}}, {"two", {{"draw", 2}}}}});
    EXPECT_TRUE(isWellFormed(bars));
    const double cut = widthBefore(bars, "cut: 1 ms"), draw = widthBefore(bars, "draw: 3 ms");
    EXPECT_GT(cut, 10);
    EXPECT_NEAR(draw, 3 * cut, 0.05);
    EXPECT_FALSE(isWellFormed("<svg><g></svg>")) << "the control";
    EXPECT_EQ(study::escaped("a<b & \"c\""), "a&lt;b &amp; &quot;c&quot;");
    EXPECT_EQ(study::shortNumber(-0.001), "0");
    EXPECT_EQ(study::shortNumber(12.50), "12.5");
}

TEST(StudyPlots, SpecificationsHoldTheData) {
    const nlohmann::json j = study::vegaOf(sample());
    ASSERT_EQ(j["data"]["values"].size(), 2u);
    EXPECT_EQ(j["data"]["values"][0]["low"], 0.9);
    EXPECT_FALSE(j["data"]["values"][1].contains("low"));
    EXPECT_EQ(j["layer"][0]["encoding"]["x"]["scale"]["type"], "log");
}

}  // namespace
}  // namespace stipple
