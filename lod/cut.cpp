#include "lod/cut.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/selector.h"

namespace stipple::lod {

namespace {

/// True if every ancestor is drawable (a child whose parent's chunk is missing is covered by a coarser ancestor).
bool isReachable(const std::vector<uint8_t>& drawable, const Hierarchy& h, uint32_t index) {
    while (index != 0) {
        index = h.nodes[index].parent;
        if (!drawable[index]) return false;
    }
    return true;
}

/// The largest code of an error that a view may allow. Where the scale ends below twice the diagonal of the root, the
/// last code stands for whatever is larger.
uint32_t largestAllowed(const Hierarchy& h) {
    const bool isWhole = h.errors.decode(ErrorScale::kLargest) >= 3.4 * std::exp2(static_cast<double>(h.rootLog2));
    return isWhole ? ErrorScale::kLargest : ErrorScale::kLargest - 1;
}

}  // namespace

Selector::Selector(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
                   CutScratch& scratch, Cut& cut)
    : hierarchies_(scene.hierarchies),
      instances_(scene.instances),
      crowds_(scene.crowds),
      residency_(residency),
      view_(view),
      budgets_(budgets),
      scratch_(scratch),
      cut_(cut) {
    ++scratch_.frame;
    scratch_.slotsUsed = 0;
    if (scratch_.slotOf.size() != instances_.size()) findDrivers();
    for (const Crowd& crowd : crowds_) isReady_.push_back(isReady(crowd));
}

void Selector::run() {
    cut_.draw.clear();
    cut_.meshDraw.clear();
    cut_.wanted.clear();
    cut_.keep.clear();
    cut_.counters = {};
    cut_.truncated = false;
    const double tau = std::max(budgets_.errorPixels, 1e-6);
    const int target = static_cast<int>(std::floor(kStepsPerOctave * std::log2(tau)));
    int step = stepForBudget(target);
    cut_.tauTarget = step == target ? tau : std::exp2(static_cast<double>(step) / kStepsPerOctave);
    // Missing chunks put parents in the place of children. That draws fewer records, except where children are
    // partly out of view, so the sum is checked and the step raised in the rare case.
    for (;; ++step) {
        cut_.draw.clear();
        cut_.wanted.clear();
        cut_.keep.clear();
        cut_.meshDraw.clear();
        cut_.counters.recordsDrawn = cut_.counters.recordsTested = cut_.counters.nodesVisited = 0;
        cut_.counters.trianglesDrawn = cut_.counters.standIns = cut_.counters.crowdMembers = 0;
        cut_.counters.nodesCulled = cut_.counters.nodesMissing = cut_.counters.nodesDrawn = 0;
        cut_.tauEffective = 0;
        wantRoots();
        beginEvaluation();
        for (const uint32_t i : scratch_.drivers) emitBest(i, step);
        cut_.counters.crowdMembers = scratch_.active.size();
        std::sort(scratch_.active.begin(), scratch_.active.end());
        for (const uint32_t i : scratch_.active) emitBest(i, step);
        if (cut_.counters.recordsDrawn + cut_.counters.trianglesDrawn <= budgets_.records || step >= kLargestTauStep)
            break;
    }
    cut_.tauEffective = std::max(cut_.tauEffective, step == target ? tau : std::exp2(double(step) / kStepsPerOctave));
    if (cut_.counters.recordsDrawn + cut_.counters.trianglesDrawn > budgets_.records) truncate();
    cut_.counters.nodesDrawn += cut_.draw.size();
}

/// Once for a scene: there may be so many instances that only to look at them takes milliseconds.
void Selector::findDrivers() {
    scratch_.slotOf.assign(instances_.size(), {0, 0});
    scratch_.activeStamp.assign(instances_.size(), 0);
    scratch_.drivers.clear();
    for (size_t i = 0; i < instances_.size(); ++i) {
        STIPPLE_CHECK(instances_[i].source < residency_.drawable.size(), "residency of a source");
        if (!instances_[i].isDriven && !hierarchyOf(i).nodes.empty())
            scratch_.drivers.push_back(static_cast<uint32_t>(i));
    }
}

/// What this frame remembers of instance i.
CutScratch::Slot& Selector::slotOf(size_t i) {
    auto& [frame, number] = scratch_.slotOf[i];
    if (frame == scratch_.frame) return scratch_.slots[number];
    frame = scratch_.frame;
    number = scratch_.slotsUsed++;
    if (number == scratch_.slots.size()) scratch_.slots.emplace_back();
    CutScratch::Slot& slot = scratch_.slots[number];
    const Hierarchy& h = hierarchyOf(i);
    slot.view = makeLocalView(h, instances_[i], view_);
    slot.sway = instances_[i].sway / (instances_[i].scale * h.unit);
    slot.inputError = instances_[i].inputError / (instances_[i].scale * h.unit * h.errors.smallest);
    if (slot.stamp.size() < h.nodes.size()) {
        slot.stamp.resize(h.nodes.size(), 0);
        slot.epsilon.resize(h.nodes.size(), 0);
    }
    return slot;
}

int32_t Selector::epsilonOf(size_t i, CutScratch::Slot& slot, uint32_t index, int32_t parentEpsilon) {
    if (slot.stamp[index] != scratch_.frame) {
        slot.stamp[index] = scratch_.frame;
        const Hierarchy& h = hierarchyOf(i);
        int32_t value = allowedError(h, h.nodes[index], slot.view, slot.sway);
        // Nested spheres give eps_child >= eps_parent; this makes it so to the last rounding.
        if (value != kCulled) value = std::max(value, parentEpsilon);
        slot.epsilon[index] = value;
    }
    return slot.epsilon[index];
}

/// Allowed error in steps of the smallest code at tau = 2^(step/32).
double Selector::allowedAt(int32_t epsilon, int step) {
    return epsilon == kInside ? 0.0 : std::exp2(static_cast<double>(epsilon + step) / kStepsPerOctave);
}
/// Allowed own error of records: what the input's error leaves of the whole.
uint32_t Selector::codeOf(const CutScratch::Slot& slot, int32_t epsilon, int step) {
    if (slot.inputError == 0) return codeAt(epsilon, step);
    const double left = allowedAt(epsilon, step) - slot.inputError;
    if (!(left >= 1)) return 0;
    return static_cast<uint32_t>(std::min(8 * std::log2(left), double{ErrorScale::kLargest}));
}

void Selector::emitBest(uint32_t i, int step) {
    uint32_t best = bestOf(i, step);
    if (best != i && !hasRoot(best)) best = i;
    cut_.counters.standIns += best != i ? 1 : 0;
    const Hierarchy& h = hierarchyOf(best);
    if (h.isMesh())
        emitMesh(best, step);
    else if (h.isProgressive)
        emitProgressive(best, step);
    else
        emitPoints(best, step);
}

uint64_t Selector::bestCost(uint32_t i, int step, uint64_t most) {
    const uint32_t best = bestOf(i, step);
    const Hierarchy& h = hierarchyOf(best);
    if (h.isMesh()) return meshCost(best, step);
    return h.isProgressive ? progressiveCost(best, step, most) : pointCost(best, step, most);
}

/// Records and triangles of the full cut (everything resident) at `step`; stops counting above the budget.
uint64_t Selector::cost(int step) {
    ++cut_.counters.evaluations;
    beginEvaluation();
    uint64_t total = 0;
    const auto add = [&](uint32_t i) {
        if (total <= budgets_.records) total += bestCost(i, step, budgets_.records - total);
    };
    for (const uint32_t i : scratch_.drivers) add(i);
    for (size_t k = 0; k < scratch_.active.size() && total <= budgets_.records; ++k) add(scratch_.active[k]);
    return total;
}

uint64_t Selector::pointCost(size_t i, int step, uint64_t most) {
    const Hierarchy& h = hierarchyOf(i);
    CutScratch::Slot& slot = slotOf(i);
    const uint32_t largest = largestAllowed(h);
    uint64_t total = 0;
    auto& stack = scratch_.stack;
    stack.assign(1, 0u);
    while (!stack.empty()) {
        const uint32_t index = stack.back();
        stack.pop_back();
        const Node& node = h.nodes[index];
        const int32_t parentEpsilon = index == 0 ? kInside : slot.epsilon[node.parent];
        const int32_t epsilon = epsilonOf(i, slot, index, parentEpsilon);
        if (epsilon == kCulled) continue;
        const uint32_t parentCode =
            index == 0 ? ErrorScale::kLargest : std::min(codeOf(slot, parentEpsilon, step), largest);
        const uint32_t code = std::min(codeOf(slot, epsilon, step), largest);
        total += h.countGreater(node.parentCounts, node.records, parentCode) -
                 h.countGreater(node.ownCounts, node.records, code);
        if (total > most) return total;
        if (node.errorCode <= code) continue;
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
    }
    return total;
}

/// Are all records of a stand-in within the error that `step` allows?
bool Selector::isGoodEnough(uint32_t standIn, int step) {
    CutScratch::Slot& slot = slotOf(standIn);
    const Hierarchy& h = hierarchyOf(standIn);
    const int32_t epsilon = epsilonOf(standIn, slot, 0, kInside);
    if (epsilon == kCulled || epsilon == kInside) return false;
    return allowedAt(epsilon, step) >= (h.isProgressive ? std::exp2(h.finestCode / 8.0) : slot.inputError);
}

/// What to draw for instance i: the coarsest of its stand-ins that is good enough, if it has fewer records than i
/// itself; else i.
uint32_t Selector::bestOf(uint32_t i, int step) {
    uint32_t best = i;
    for (uint32_t next = instances_[i].standIn; next != Instance::kNone && isGoodEnough(next, step);
         next = instances_[next].standIn)
        best = next;
    if (best == i) return i;
    const bool isMesh = hierarchyOf(i).isMesh();
    constexpr uint64_t kAll = std::numeric_limits<uint64_t>::max();
    const uint64_t most = isMesh ? meshCost(i, step) : kAll;
    const uint64_t points =
        hierarchyOf(best).isProgressive ? progressiveCost(best, step, most) : pointCost(best, step, most);
    if (isMesh) return points < most ? best : i;
    // Its root alone has more: no need to look further.
    return points <= hierarchyOf(i).nodes[0].records || points <= pointCost(i, step, points) ? best : i;
}

/// The smallest step >= target whose full cut fits the budget (cost falls with the step).
int Selector::stepForBudget(int target) {
    if (budgets_.records == std::numeric_limits<uint64_t>::max()) return target;
    // From the coarse side, so that no evaluation walks much more than the budget's worth of nodes.
    int hi = std::max(target, 0) + 8 * kStepsPerOctave;
    while (hi < kLargestTauStep && cost(hi) > budgets_.records)
        hi = std::min(hi + 8 * kStepsPerOctave, kLargestTauStep);
    int lo = target;
    if (cost(lo) <= budgets_.records) return lo;
    while (hi - lo > 1) {
        const int middle = lo + (hi - lo) / 2;
        (cost(middle) <= budgets_.records ? hi : lo) = middle;
    }
    return hi;
}

/// Can the points that stand in be drawn? Asks for them if not: meanwhile the mesh is drawn.
bool Selector::hasRoot(uint32_t i) {
    const uint32_t source = instances_[i].source;
    if (residency_.drawable[source][0]) return true;
    cut_.wanted.push_back({source, 0, 1e9f});
    return false;
}

/// Screen-space error, px, of error code `code` at a node with allowed error `epsilon`.
double Selector::pixelsOf(const CutScratch::Slot& slot, uint32_t code, int32_t epsilon) {
    const double error = (code == 0 ? 0 : std::exp2(code / 8.0)) + slot.inputError;
    if (error == 0) return 0;
    return epsilon == kInside ? 1e6 : error * std::exp2(-static_cast<double>(epsilon) / kStepsPerOctave);
}

void Selector::emitPoints(uint32_t i, int step) {
    const Hierarchy& h = hierarchyOf(i);
    if (h.nodes.empty()) return;
    const uint32_t source = instances_[i].source;
    const std::vector<uint8_t>& drawable = residency_.drawable[source];
    CutScratch::Slot& slot = slotOf(i);
    const uint32_t largest = largestAllowed(h);
    const size_t firstDraw = cut_.draw.size();
    auto& stack = scratch_.stack;
    stack.assign(1, 0u);
    while (!stack.empty()) {
        const uint32_t index = stack.back();
        stack.pop_back();
        const Node& node = h.nodes[index];
        ++cut_.counters.nodesVisited;
        const int32_t parentEpsilon = index == 0 ? kInside : slot.epsilon[node.parent];
        const int32_t epsilon = epsilonOf(i, slot, index, parentEpsilon);
        if (epsilon == kCulled) {
            ++cut_.counters.nodesCulled;
            continue;
        }
        const bool isDrawable = drawable[index] != 0;
        const uint32_t code = std::min(codeOf(slot, epsilon, step), largest);
        if (isDrawable) {
            cut_.keep.emplace_back(source, index);
        } else {
            ++cut_.counters.nodesMissing;
            const double pixels = index == 0 ? 1e9 : pixelsOf(slot, h.nodes[node.parent].errorCode, parentEpsilon);
            cut_.wanted.push_back({source, index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
        }
        uint32_t octantMask = 0;
        if (node.errorCode > code) {
            uint32_t child = node.firstChild;
            for (uint32_t octant = 0; octant < 8; ++octant) {
                if (!(node.childMask >> octant & 1u)) continue;
                stack.push_back(child);
                // A child out of view is not drawn and not missing either.
                if (!drawable[child] && epsilonOf(i, slot, child, epsilon) != kCulled) octantMask |= 1u << octant;
                ++child;
            }
        }
        // Only what hangs together with the root is drawn: a node whose parent is missing is covered above.
        if (!isDrawable || !isReachable(drawable, h, index)) continue;
        const uint32_t parentCode =
            index == 0 ? ErrorScale::kLargest : std::min(codeOf(slot, parentEpsilon, step), largest);
        const uint32_t count = h.countGreater(node.parentCounts, node.records, parentCode);
        if (count == 0) continue;
        const uint32_t tooCoarse = octantMask ? 0 : h.countGreater(node.ownCounts, node.records, code);
        cut_.counters.recordsDrawn += count - tooCoarse;
        cut_.counters.recordsTested += count;
        const uint32_t drawnCode = octantMask ? node.errorCode : std::min<uint32_t>(node.errorCode, code);
        const double delivered = pixelsOf(slot, drawnCode, drawnCode > largest ? kInside : epsilon);
        if (octantMask) cut_.tauEffective = std::max(cut_.tauEffective, delivered);
        if (count > tooCoarse) cut_.draw.push_back({i, index, count, code, octantMask, static_cast<float>(delivered)});
    }
    std::sort(cut_.draw.begin() + static_cast<std::ptrdiff_t>(firstDraw), cut_.draw.end(),
              [](const CutDraw& a, const CutDraw& b) { return a.node < b.node; });
}

/// Even the coarsest cut is too large: leave out records, finest first, and say so.
void Selector::truncate() {
    cut_.truncated = true;
    uint64_t left = budgets_.records;
    for (CutDraw& draw : cut_.draw) {
        draw.count = static_cast<uint32_t>(std::min<uint64_t>(draw.count, left));
        left -= draw.count;
    }
    std::erase_if(cut_.draw, [](const CutDraw& d) { return d.count == 0; });
    cut_.counters.recordsDrawn = budgets_.records - left;
    uint64_t triangles = 0;
    std::erase_if(cut_.meshDraw, [&](const CutMeshDraw& d) {
        const bool isLeftOut = triangles + d.triangles > left;
        if (!isLeftOut) triangles += d.triangles;
        return isLeftOut;
    });
    cut_.counters.trianglesDrawn = triangles;
}

void selectCut(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
               CutScratch& scratch, Cut& cut) {
    Selector(scene, residency, view, budgets, scratch, cut).run();
}

}  // namespace stipple::lod
