// What the cuts of all kinds share: a frame's inputs, the allowed errors of its nodes, and the members of instance
// groups that are drawn themselves.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <span>

#include "lod/cut/cut.h"
#include "lod/cut/resident.h"
#include "lod/cut/view.h"
#include "lod/primitives/kinds.h"

namespace stipple::lod {

/// One frame of selectCut. What is worked out of it on the way is remembered in `scratch` and the same whenever it is
/// asked for: to ask is to change nothing.
struct CutFrame {
    const CutScene& scene;
    const Residency& residency;
    const View& view;
    CutScratch& scratch;
    bool hasNoOverviews = false;  ///< roots are drawn as what they hold themselves at least

    const Instance& instance(uint32_t i) const { return scene.instances[i]; }
    const Hierarchy& hierarchyOf(uint32_t i) const { return *scene.hierarchies[instance(i).hierarchy]; }
    const std::vector<uint8_t>& drawableOf(uint32_t i) const { return residency.drawable[instance(i).source]; }
};

/// The members of instance groups that are drawn themselves, each once.
struct ActiveMembers {
    CutScratch::Members& of;
    void clear() {
        ++of.evaluation;
        of.active.clear();
    }
    /// Those that a leaf of the group's points stands for.
    void activate(const InstanceGroup& group, uint32_t leaf) {
        for (uint32_t k = group.first[leaf]; k < group.first[leaf + 1]; ++k) {
            const uint32_t member = group.members[k];
            if (of.stamp[member] == of.evaluation) continue;
            of.stamp[member] = of.evaluation;
            of.active.push_back(member);
        }
    }
};

/// What a frame remembers of instance i.
CutScratch::Slot& slotOf(const CutFrame& frame, uint32_t i);

/// Allowed error at tau = 1 px of a node, given its parent's (kInside: it has none).
inline int32_t epsilonOf(const CutFrame& frame, const Hierarchy& h, const CutScratch::Slot& slot, uint32_t node,
                         int32_t parentEpsilon) {
    CutScratch::Allowed& memo = frame.scratch.allowed[slot.first + node];
    if (memo.frame != frame.scratch.frame) {
        memo.frame = frame.scratch.frame;
        memo.epsilon = allowedError(h, h.nodes[node], slot.view, slot.sway);
        // Nested spheres give eps_child >= eps_parent; this makes it so to the last rounding.
        if (memo.epsilon != kCulled) memo.epsilon = std::max(memo.epsilon, parentEpsilon);
    }
    return memo.epsilon;
}
/// The same of a node that was asked about before.
inline int32_t epsilonAt(const CutFrame& frame, const CutScratch::Slot& slot, uint32_t node) {
    return frame.scratch.allowed[slot.first + node].epsilon;
}

/// Allowed error in steps of the smallest code at tau = 2^(step/32).
inline double allowedAt(int32_t epsilon, int step) {
    return epsilon == kInside ? 0.0 : std::exp2(static_cast<double>(epsilon + step) / kStepsPerOctave);
}

/// Screen-space error, px, of error code `code`, times `larger`, at a node with allowed error `epsilon`.
inline double pixelsOf(const CutScratch::Slot& slot, uint32_t code, int32_t epsilon, double larger = 1) {
    const double error = (code == 0 ? 0 : larger * std::exp2(code / 8.0)) + slot.inputError;
    if (error == 0) return 0;
    return epsilon == kInside ? 1e6 : error * std::exp2(-static_cast<double>(epsilon) / kStepsPerOctave);
}

/// Of a payload of records: where those that are looked at begin and end (before are levels of the overview that are
/// too coarse), and how many of them are left to the children.
struct Prefix {
    uint32_t first, end, tooCoarse;
    uint32_t drawn() const { return end - first - tooCoarse; }
};
inline Prefix prefixOf(const Hierarchy& h, const Payload& p, const Asked& asked) {
    const uint32_t coarse = h.countGreater(p.ownCounts, p.records, asked.code),
                   first = asked.code < p.errorCode ? h.overviewOf(p) : coarse,
                   end = std::max(first, h.countGreater(p.parentCounts, p.records, asked.parentCode));
    return {first, end, asked.octantMask != 0 ? 0 : coarse - first};
}

// ---- the cut of one view, in the parts that cuts of several views are made of

inline constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max();

/// tau that is asked for, and its step.
struct Target {
    explicit Target(double errorPixels)
        : tau(std::max(errorPixels, 1e-6)), step(static_cast<int>(std::floor(kStepsPerOctave * std::log2(tau)))) {}
    double tau;
    int step;
};
/// The step whose full cut fits a budget, and the one of what is drawn: missing chunks put parents in the place of
/// children. That draws fewer records, except where children are partly out of view: then the step is raised until what
/// can be drawn fits.
struct PlannedStep {
    int planned = 0, drawn = 0;
};

/// Empties `cut`, and begins a frame of the view's scratch. `unrefined`: Budgets::unrefined.
void beginCut(const CutFrame& frame, std::span<const PlacedNode> unrefined, Cut& cut);
/// Records and triangles of the whole cut at `step`; stops counting above the budget.
CutCost costOfCut(const CutFrame& frame, int step, uint64_t budget, Counted counted);
void emitCutAt(const CutFrame& frame, const PlannedStep& step, const Target& target, uint64_t budget, Cut& cut);

/// The smallest steps from `target` on that fit (cost falls with the step). cost(step, most, counted): as costOfCut.
template <typename Cost>
PlannedStep planStep(const Cost& cost, int target, uint64_t budget, CutCounters& counters) {
    if (budget == kNoLimit) return {target, target};
    bool isWhole = false;  // of the last that fitted
    const auto fits = [&](int step) {
        ++counters.evaluations;
        const CutCost found = cost(step, budget, Counted::all);
        if (found.records > budget) return false;
        isWhole = found.isWhole;
        return true;
    };
    // From the coarse side, so that no evaluation walks much more than the budget's worth of nodes.
    int hi = std::max(target, 0) + 8 * kStepsPerOctave;
    while (hi < kLargestTauStep && !fits(hi)) hi = std::min(hi + 8 * kStepsPerOctave, kLargestTauStep);
    int lo = target;
    if (fits(lo)) {
        hi = lo;
    } else {
        while (hi - lo > 1) {
            const int middle = lo + (hi - lo) / 2;
            (fits(middle) ? hi : lo) = middle;
        }
    }
    int drawn = hi;
    if (!isWhole)
        while (drawn < kLargestTauStep && cost(drawn, budget, Counted::drawable).records > budget) ++drawn;
    return {hi, drawn};
}

/// As planResident of a view: cutOf(residency) is the cut of all that is shown, with what it misses and needs.
void planResident(const CutScene& scene, uint64_t residentBytes, std::span<const std::pair<uint32_t, uint32_t>> barred,
                  const std::function<const Cut&(const Residency&)>& cutOf, ResidentPlan& plan);

/// Error code of the level of the overview that is drawn where `code` is allowed.
inline uint32_t errorOfOverview(const Hierarchy& h, const Payload& p, uint32_t code) {
    const uint32_t coarser = h.countGreater(p.ownCounts, p.records, code);
    while (code > p.errorCode && h.countGreater(p.ownCounts, p.records, code - 1) == coarser) --code;
    return code;
}

/// Error, px, of what is drawn of a payload whose largest own error is `errorCode`.
inline double deliveredPixels(const CutScratch::Slot& slot, uint32_t errorCode, const Asked& asked) {
    const uint32_t drawn = asked.octantMask ? errorCode : std::min(errorCode, asked.code);
    return pixelsOf(slot, drawn, drawn > asked.largestCode ? kInside : asked.epsilon);
}

/// Tells the cut of what is drawn of a leaf that is not exact.
inline void tellLeafError(const Node& node, int32_t epsilon, Cut& cut) {
    if (node.sourceCode == 0 || !node.isLeaf()) return;
    if (epsilon == kInside)
        ++cut.counters.leavesAround;
    else
        cut.tauEffective = std::max(cut.tauEffective,
                                    std::exp2(node.sourceCode / 8.0 - static_cast<double>(epsilon) / kStepsPerOctave));
}

/// emitRecords, of a payload whose node and frame are at hand.
inline void appendRecords(const CutScratch::Slot& slot, const Hierarchy& h, uint32_t instance, uint32_t node,
                          uint32_t chunk, const Payload& p, const Asked& asked, Cut& cut) {
    const Prefix prefix = prefixOf(h, p, asked);
    const uint32_t count = prefix.end - prefix.first;
    if (count == 0) return;
    cut.counters.recordsDrawn += prefix.drawn();
    cut.counters.recordsTested += count;
    const uint32_t error = prefix.first < h.overviewOf(p) ? errorOfOverview(h, p, asked.code) : p.errorCode;
    const double delivered = deliveredPixels(slot, error, asked);
    if (asked.octantMask) cut.tauEffective = std::max(cut.tauEffective, delivered);
    tellLeafError(h.nodes[node], asked.epsilon, cut);
    if (prefix.drawn() > 0)
        cut.draw.push_back(
            {instance, node, chunk, prefix.first, count, asked.code, asked.octantMask, static_cast<float>(delivered)});
}

/// Entries of kinds.h: what cuts of octrees have of payloads ...
uint64_t costOfRecords(const Hierarchy& h, uint32_t chunk, const Asked& asked);
void emitRecords(const CutFrame& frame, uint32_t instance, uint32_t chunk, const Asked& asked, Cut& cut);
uint64_t costOfClusters(const Hierarchy& h, uint32_t chunk, const Asked& asked);
void emitClusters(const CutFrame& frame, uint32_t instance, uint32_t chunk, const Asked& asked, Cut& cut);
/// ... and the cuts of stores of each shape.
CutCost costOfTree(const CutFrame& frame, uint32_t instance, int step, uint64_t most, Counted counted,
                   ActiveMembers* members);
void emitTree(const CutFrame& frame, uint32_t instance, int step, ActiveMembers& members, Cut& cut);
CutCost costOfStochastic(const CutFrame& frame, uint32_t instance, int step, uint64_t most, Counted counted,
                         ActiveMembers* members);
void emitStochastic(const CutFrame& frame, uint32_t instance, int step, ActiveMembers& members, Cut& cut);
CutCost costOfGraph(const CutFrame& frame, uint32_t instance, int step, uint64_t most, Counted counted,
                    ActiveMembers* members);
void emitGraph(const CutFrame& frame, uint32_t instance, int step, ActiveMembers& members, Cut& cut);

}  // namespace stipple::lod
