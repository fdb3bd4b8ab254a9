#include "apps/study/sweep/arrivals.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "engine/base/process.h"
#include "engine/reference/reference.h"

namespace stipple::study {
namespace {

constexpr uint32_t kMostSteps = 300;
constexpr double kMostSeconds = 20, kGood = 30;

Result<double> decibelsOf(const render::Image& image, const render::Image& complete) {
    STIPPLE_ASSIGN(const auto difference, reference::compareImages(image, complete, 4, nullptr));
    return std::min(difference.foregroundPsnr, kSameDecibels);
}

/// Frames until nothing is on its way; pictures are judged afterwards, as that takes time.
Result<std::vector<ArrivalStep>> arrive(const ArrivalStep& of, const lod::View& view, render::Mode mode, double target,
                                        SceneDrawer& drawer, const render::Image& complete) {
    std::vector<ArrivalStep> steps;
    std::vector<render::Image> images;
    const uint64_t before = drawer.counters().bytesStreamed;
    const double start = nowSeconds();
    for (uint32_t frame = 0; steps.size() < kMostSteps; ++frame) {
        STIPPLE_ASSIGN(const render::Image* image, drawer.drawArrived(view, mode, target));
        const FrameCounters& c = drawer.counters();
        ArrivalStep step = of;
        step.frame = frame;
        step.seconds = nowSeconds() - start;
        step.bytes = static_cast<double>(c.bytesStreamed - before);
        step.stated = c.tauEffectivePixels;
        step.isComplete = c.nodesMissing == 0 && c.requestsInFlight == 0;
        // Frames in which nothing came are the one before.
        if (steps.empty() || step.bytes > steps.back().bytes || step.isComplete) {
            steps.push_back(step);
            images.push_back(*image);
        }
        if (step.isComplete || step.seconds > kMostSeconds) break;
    }
    for (size_t i = 0; i < steps.size(); ++i) {
        STIPPLE_ASSIGN(steps[i].decibels, decibelsOf(images[i], complete));
    }
    return steps;
}

}  // namespace

Result<std::vector<ArrivalStep>> measureArrivals(uint32_t number, const StudyScene& scene, const glm::uvec2& size,
                                                 render::Mode mode, double target, SceneDrawer& drawer,
                                                 SceneDrawer& complete) {
    std::vector<ArrivalStep> all;
    std::set<std::string> seen;
    for (uint32_t v = 0; v < scene.views.size(); ++v) {
        const std::string& path = scene.views[v].path;
        if (!seen.insert(path).second) continue;
        const lod::View view = viewOf(scene, size, v);
        STIPPLE_ASSIGN(const render::Image* whole, complete.draw(view, mode, target));
        ArrivalStep of;
        of.scene = number;
        of.event = seen.size() == 1 ? "cold start" : "jump to " + csvName(path);
        STIPPLE_ASSIGN(const auto steps, arrive(of, view, mode, target, drawer, *whole));
        all.insert(all.end(), steps.begin(), steps.end());
    }
    return all;
}

CsvRow arrivalHead() { return {"scene", "event", "frame", "seconds", "bytes", "stated_px", "db", "complete"}; }
CsvRow arrivalRow(const ArrivalStep& s) {
    return {std::to_string(s.scene), s.event,
            std::to_string(s.frame), csvNumber(s.seconds),
            csvNumber(s.bytes),      csvNumber(s.stated),
            csvNumber(s.decibels),   s.isComplete ? "1" : "0"};
}
ArrivalStep arrivalOf(const CsvRow& row) {
    ArrivalStep s;
    s.scene = static_cast<uint32_t>(std::strtoul(row[0].c_str(), nullptr, 10));
    s.event = row[1];
    s.frame = static_cast<uint32_t>(std::strtoul(row[2].c_str(), nullptr, 10));
    s.seconds = numberOf(row[3]);
    s.bytes = numberOf(row[4]);
    s.stated = numberOf(row[5]);
    s.decibels = numberOf(row[6]);
    s.isComplete = row[7] == "1";
    return s;
}

std::vector<ArrivalFacts> arrivalFacts(const std::vector<ArrivalStep>& steps, uint32_t scene) {
    std::vector<ArrivalFacts> all;
    for (const ArrivalStep& s : steps) {
        if (s.scene != scene) continue;
        if (all.empty() || all.back().event != s.event) {
            all.push_back({});
            all.back().event = s.event;
            all.back().firstSeconds = all.back().goodSeconds = all.back().goodBytes =
                std::numeric_limits<double>::quiet_NaN();
        }
        ArrivalFacts& f = all.back();
        if (std::isnan(f.firstSeconds) && s.decibels >= 1) f.firstSeconds = s.seconds;
        if (std::isnan(f.goodSeconds) && s.decibels >= kGood) {
            f.goodSeconds = s.seconds;
            f.goodBytes = s.bytes;
        }
        f.completeSeconds = s.seconds;
        f.allBytes = s.bytes;
        f.isComplete = s.isComplete;
    }
    return all;
}

std::vector<Chart> arrivalCharts(const std::vector<ArrivalStep>& steps, uint32_t scene, const std::string& name) {
    const char* const y = "dB against the whole frame (99: the same)";
    Chart seconds{name + "-arrival-seconds",
                  "From a cold start and after jumps: error against time",
                  "seconds",
                  y,
                  true,
                  false,
                  {},
                  false,
                  0,
                  ""};
    Chart bytes{name + "-arrival-bytes",
                "From a cold start and after jumps: error against bytes",
                "MB of the file that came",
                y,
                false,
                false,
                {},
                false,
                0,
                ""};
    for (const ArrivalStep& s : steps) {
        if (s.scene != scene) continue;
        for (Chart* chart : {&seconds, &bytes}) {
            if (chart->series.empty() || chart->series.back().name != s.event) chart->series.push_back({s.event, {}});
            const double x = chart == &seconds ? s.seconds : s.bytes / 1e6;
            chart->series.back().points.push_back(
                {x, s.decibels, {}, s.event + ", frame " + std::to_string(s.frame), false});
        }
    }
    return {seconds, bytes};
}

}  // namespace stipple::study
