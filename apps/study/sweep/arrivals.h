// How a picture comes: from nothing resident (a cold start), and after the camera has jumped to where another path
// begins. In real time, frame after frame, of files that the operating system has read before.
#pragma once

#include "apps/study/plots/chart.h"
#include "apps/study/sweep/journal.h"
#include "apps/study/sweep/scene_drawer.h"

namespace stipple::study {

/// A frame on the way.
struct ArrivalStep {
    uint32_t scene = 0;
    std::string event;  ///< "cold start", or "jump to PATH"
    uint32_t frame = 0;
    double seconds = 0, bytes = 0;  ///< since the event; bytes of the file that came
    double stated = 0;              ///< px, that the frame says it keeps
    double decibels = 0;            ///< foreground, against the same frame with all that it wants; kSameDecibels: equal
    bool isComplete = false;        ///< nothing is on its way any more
};
inline constexpr double kSameDecibels = 99;

/// Of one scene at one size: the first camera of each path in turn, in the mode and at the error given. `drawer`:
/// fresh, nothing is resident in it; `complete`: another one.
Result<std::vector<ArrivalStep>> measureArrivals(uint32_t number, const StudyScene& scene, const glm::uvec2& size,
                                                 render::Mode mode, double target, SceneDrawer& drawer,
                                                 SceneDrawer& complete);

CsvRow arrivalHead();
CsvRow arrivalRow(const ArrivalStep& step);
ArrivalStep arrivalOf(const CsvRow& row);

/// What a table says of an event.
struct ArrivalFacts {
    std::string event;
    double firstSeconds = 0;                   ///< to the first picture that shows anything (1 dB and more)
    double goodSeconds = 0, goodBytes = 0;     ///< to 30 dB
    double completeSeconds = 0, allBytes = 0;  ///< to the end
    bool isComplete = false;
};
std::vector<ArrivalFacts> arrivalFacts(const std::vector<ArrivalStep>& steps, uint32_t scene);
/// dB against seconds and against bytes.
std::vector<Chart> arrivalCharts(const std::vector<ArrivalStep>& steps, uint32_t scene, const std::string& name);

}  // namespace stipple::study
