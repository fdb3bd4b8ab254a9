#include "lod/cut/views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "lod/cut/frame.h"

namespace stipple::lod {
namespace {

constexpr float kBelowPrimary = 1e-12f;  // of the priority of what only secondary views miss

/// Views of one rank, which have one step of tau.
struct Rank {
    std::vector<CutFrame> frames;
    double tau = std::numeric_limits<double>::infinity();
    Target target() const { return Target(tau); }
    /// Records of all its views at `step`; stops counting above `most`.
    CutCost cost(int step, uint64_t most, Counted counted) const {
        CutCost sum;
        for (const CutFrame& frame : frames) {
            if (sum.records > most) break;
            const CutCost cost = costOfCut(frame, step, most - sum.records, counted);
            sum.records += cost.records;
            sum.isWhole = sum.isWhole && cost.isWhole;
        }
        return sum;
    }
    /// The smallest step from `target` on that fits, for planning and for drawing what is there.
    PlannedStep plan(uint64_t most, CutCounters& counters) const {
        if (frames.empty()) return {0, 0};
        return planStep([&](int step, uint64_t limit, Counted counted) { return cost(step, limit, counted); },
                        target().step, most, counters);
    }
};

/// Records that are set aside for secondary views: of the overviews of all roots, which is the least that there is, or
/// better of the roots' own records, as long as those are a quarter of the budget at most.
uint64_t leastOf(const Rank& secondary, uint64_t budget) {
    constexpr uint64_t kShare = 4;
    const uint64_t overviews = secondary.cost(kLargestTauStep, budget, Counted::all).records;
    Rank roots = secondary;
    for (CutFrame& frame : roots.frames) frame.hasNoOverviews = true;
    const uint64_t own = roots.cost(kLargestTauStep, budget / kShare, Counted::all).records;
    return std::max(overviews, std::min(own, budget / kShare));
}

/// What several cuts miss and need, each chunk once.
void merge(std::span<const ViewRequest> views, CutOfViews& out) {
    Cut& merged = out.merged;
    merged.wanted.clear();
    merged.keep.clear();
    for (size_t v = 0; v < views.size(); ++v) {
        const float share = views[v].isSecondary ? kBelowPrimary : 1.0f;
        for (CutWanted w : out.views[v].wanted) {
            w.priority *= share;
            merged.wanted.push_back(w);
        }
        merged.keep.insert(merged.keep.end(), out.views[v].keep.begin(), out.views[v].keep.end());
    }
    if (views.size() == 1) return;  // in its own order
    const auto isSame = [](const CutWanted& a, const CutWanted& b) {
        return a.source == b.source && a.chunk == b.chunk;
    };
    std::sort(merged.wanted.begin(), merged.wanted.end(), [](const CutWanted& a, const CutWanted& b) {
        if (a.source != b.source) return a.source < b.source;
        return a.chunk != b.chunk ? a.chunk < b.chunk : a.priority > b.priority;
    });
    merged.wanted.erase(std::unique(merged.wanted.begin(), merged.wanted.end(), isSame), merged.wanted.end());
    std::sort(merged.keep.begin(), merged.keep.end());
    merged.keep.erase(std::unique(merged.keep.begin(), merged.keep.end()), merged.keep.end());
}

}  // namespace

void selectCuts(const CutScene& scene, const Residency& residency, std::span<const ViewRequest> views, uint64_t records,
                ViewsScratch& scratch, CutOfViews& out) {
    out.views.resize(views.size());
    if (scratch.views.size() < views.size()) scratch.views.resize(views.size());
    std::array<Rank, 2> ranks;  // primary, secondary
    for (size_t v = 0; v < views.size(); ++v) {
        Rank& rank = ranks.at(views[v].isSecondary ? 1 : 0);
        rank.frames.push_back({scene, residency, views[v].view, scratch.views[v]});
        rank.tau = std::min(rank.tau, views[v].errorPixels);
        beginCut(rank.frames.back(), views[v].unrefined, out.views[v]);
    }
    // What secondary views cannot do without is set aside; what primary ones leave is theirs.
    CutCounters evaluations;
    const bool isLimited = records != kNoLimit;
    const uint64_t least = isLimited ? leastOf(ranks[1], records) : 0;
    std::array<PlannedStep, 2> steps{};
    steps[0] = ranks[0].plan(isLimited ? records - std::min(least, records) : records, evaluations);
    uint64_t left = records;
    if (isLimited && !ranks[0].frames.empty()) {
        const uint64_t used = ranks[0].cost(steps[0].drawn, records, Counted::drawable).records;
        left =
            records - std::min(records, std::max(used, ranks[0].cost(steps[0].planned, records, Counted::all).records));
    }
    steps[1] = ranks[1].plan(left, evaluations);
    std::array<size_t, 2> next{};
    uint64_t room = records;
    for (const size_t rank : {size_t{0}, size_t{1}})
        for (size_t v = 0; v < views.size(); ++v) {
            if (views[v].isSecondary != (rank == 1)) continue;
            Cut& cut = out.views[v];
            emitCutAt(ranks.at(rank).frames[next.at(rank)++], steps.at(rank), ranks.at(rank).target(), room, cut);
            room -= std::min(room, cut.counters.recordsDrawn + cut.counters.trianglesDrawn);
            cut.counters.evaluations = evaluations.evaluations;
        }
    merge(views, out);
}

void planResident(const CutScene& scene, std::span<const ViewRequest> views, uint64_t records, uint64_t residentBytes,
                  std::span<const std::pair<uint32_t, uint32_t>> barred, ViewsScratch& scratch, CutOfViews& cut,
                  ResidentPlan& plan) {
    planResident(
        scene, residentBytes, barred,
        [&](const Residency& residency) -> const Cut& {
            selectCuts(scene, residency, views, records, scratch, cut);
            return cut.merged;
        },
        plan);
}

}  // namespace stipple::lod
