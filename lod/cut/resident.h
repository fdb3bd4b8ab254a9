// planResident: which chunks a view shows where memory holds no more than some. Like the cut a pure function over plain
// arrays: of the scene, the view and the budgets, and neither of the order in which chunks arrive nor of what was drawn
// before. Pictures that are made to be kept hang on it; the window, which never waits, shows what it has.
//
// Where all that the cut needs fits, that is the plan. Elsewhere it grows from nothing: the cut says what it misses,
// what would remove most error is taken in first (parents before what builds on them), until nothing more fits. What
// did not fit once is not asked for again, so that it ends; what the cut stops needing gives way.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "lod/cut/cut.h"

namespace stipple::lod {

struct ResidentPlan {
    std::vector<std::vector<uint8_t>> chunks;  ///< of each source, a byte a chunk: 1 where it is resident
    uint64_t bytes = 0;                        ///< of all of them, decoded
    uint64_t refused = 0;                      ///< chunks that the cut goes on wanting: there is no room
    /// (source, chunk) that the cut wants and the node table does not know yet: the plan holds once it does.
    std::vector<std::pair<uint32_t, uint32_t>> unknown;
    bool isComplete() const { return refused == 0; }
};

/// The order in which chunks are taken in: what removes most error first, equals by their numbers.
inline bool isMoreUrgent(const CutWanted& a, const CutWanted& b) {
    if (a.priority != b.priority) return a.priority > b.priority;
    return a.source != b.source ? a.source < b.source : a.chunk < b.chunk;
}

/// `plan` and `cut` are filled; their memory is reused. `residentBytes`: of decoded chunks. `barred`: (source, chunk)
/// that cannot be had, e.g. as they cannot be read.
void planResident(const CutScene& scene, const View& view, const Budgets& budgets, uint64_t residentBytes,
                  std::span<const std::pair<uint32_t, uint32_t>> barred, CutScratch& scratch, Cut& cut,
                  ResidentPlan& plan);

}  // namespace stipple::lod
