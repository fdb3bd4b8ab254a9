// The counters of one frame: what tests assert, the overlay prints and --json gives.
#pragma once

#include <cstdint>

namespace stipple {

struct FrameCounters {
    uint64_t nodesVisited = 0, nodesDrawn = 0, nodesCulled = 0, nodesMissing = 0;
    uint64_t recordsDrawn = 0, recordsTested = 0, trianglesDrawn = 0;
    uint64_t proxies = 0;                         ///< instances of which points were drawn
    uint64_t groupMembers = 0;                    ///< instances of instance groups that were looked at one by one
    uint64_t nodesHidden = 0, recordsHidden = 0;  ///< of those drawn: left out, as they are behind others
    uint64_t nodesLeftCoarse = 0;  ///< of those drawn: not refined, as they are hidden and the budget is short
    uint64_t nodesSeenCoarse = 0;  ///< of these: seen all the same, and refined in the next frame
    uint64_t nodesSwaying = 0;     ///< moved by wind, by a tenth of a pixel at least
    uint64_t shadowMaps = 0, shadowMapsDrawn = 0;  ///< of lights that cast shadows; of those drawn in this frame
    uint64_t shadowLightsLeft = 0;                 ///< lights that would cast, beyond those that do
    uint64_t cutEvaluations = 0, passes = 0, blocks = 0;
    uint64_t bytesStreamed = 0, residentBytes = 0, requests = 0, uploads = 0, evictions = 0, failures = 0, refused = 0;
    uint64_t requestsInFlight = 0;
    bool budgetTruncated = false;
    double tauTargetPixels = 0;     ///< what the budget allows once everything is resident
    double tauEffectivePixels = 0;  ///< what this frame delivers
    double cutMs = 0, frameMs = 0;
};

}  // namespace stipple
