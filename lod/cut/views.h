// The cuts of several views of one frame: two eyes, or a camera and the lights that cast shadows. They share what is
// resident and what may be drawn. Views of equal rank are as accurate as each other (two eyes see one thing); where the
// budget does not do for all, the secondary ones become coarser first, as far as they can, and only then the others.
// Pure, as selectCut is; of one view it is the same.
#pragma once

#include <span>
#include <vector>

#include "lod/cut/cut.h"
#include "lod/cut/resident.h"

namespace stipple::lod {

struct ViewRequest {
    View view;
    double errorPixels = 1;  ///< tau asked for; of primary views the smallest counts for all, and so of secondary ones
    bool isSecondary = false;                 ///< seen by nobody: what it decides may be coarser
    std::span<const PlacedNode> unrefined{};  ///< as Budgets has them
};

/// Reused between frames: a scratch a view.
struct ViewsScratch {
    std::vector<CutScratch> views;
};

struct CutOfViews {
    std::vector<Cut> views;  ///< in the order of the requests
    /// What all of them miss, each once with its greatest priority (of secondary views only: below all others), and
    /// what any of them needs. Nothing is drawn of it.
    Cut merged;
};

/// Records and triangles of all views together are at most `records`, unless one is `truncated`.
void selectCuts(const CutScene& scene, const Residency& residency, std::span<const ViewRequest> views, uint64_t records,
                ViewsScratch& scratch, CutOfViews& out);

/// As planResident: the chunks that all views show together where memory holds no more than some.
void planResident(const CutScene& scene, std::span<const ViewRequest> views, uint64_t records, uint64_t residentBytes,
                  std::span<const std::pair<uint32_t, uint32_t>> barred, ViewsScratch& scratch, CutOfViews& cut,
                  ResidentPlan& plan);

}  // namespace stipple::lod
