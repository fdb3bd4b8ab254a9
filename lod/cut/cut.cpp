#include "lod/cut/cut.h"

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/cut/frame.h"

namespace stipple::lod {

CutScratch::Slot& slotOf(const CutFrame& frame, uint32_t i) {
    CutScratch& scratch = frame.scratch;
    auto& [seen, number] = scratch.slotOf[i];
    if (seen == scratch.frame) return scratch.slots[number];
    seen = scratch.frame;
    number = scratch.slotsUsed++;
    if (number == scratch.slots.size()) scratch.slots.emplace_back();
    CutScratch::Slot& slot = scratch.slots[number];
    const Hierarchy& h = frame.hierarchyOf(i);
    const Instance& instance = frame.instance(i);
    slot.view = makeLocalView(h, instance, frame.view);
    slot.sway = instance.sway / (instance.scale * h.unit);
    slot.inputError = instance.inputError / (instance.scale * h.unit * h.errors.smallest);
    slot.first = scratch.allowedUsed;
    scratch.allowedUsed += h.nodes.size();
    if (scratch.allowed.size() < scratch.allowedUsed)
        scratch.allowed.resize(std::max(scratch.allowedUsed, 2 * scratch.allowed.size()));
    return slot;
}

namespace {

CutCost costOf(const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted = Counted::all,
               ActiveMembers* members = nullptr) {
    return shapeOf(frame.hierarchyOf(i)).cutCost(frame, i, step, most, counted, members);
}

/// Once for a scene: there may be so many instances that only to look at them takes milliseconds.
void findDrivers(const CutFrame& frame) {
    CutScratch& scratch = frame.scratch;
    const auto instances = frame.scene.instances;
    scratch.slotOf.assign(instances.size(), {0, 0});
    scratch.members.stamp.assign(instances.size(), 0);
    scratch.drivers.clear();
    for (uint32_t i = 0; i < instances.size(); ++i) {
        STIPPLE_CHECK(instances[i].source < frame.residency.drawable.size(), "residency of a source");
        if (!instances[i].isDriven && !frame.hierarchyOf(i).nodes.empty()) scratch.drivers.push_back(i);
    }
}

/// Can the members of an instance group be drawn?
bool isReady(const CutFrame& frame, const InstanceGroup& group) {
    return std::all_of(group.sources.begin(), group.sources.end(),
                       [&](uint32_t source) { return frame.residency.drawable[source][0] != 0; });
}

/// Are all records of a proxy within the error that `step` allows?
bool isGoodEnough(const CutFrame& frame, uint32_t proxy, int step) {
    const CutScratch::Slot& slot = slotOf(frame, proxy);
    const Hierarchy& h = frame.hierarchyOf(proxy);
    const int32_t epsilon = epsilonOf(frame, h, slot, 0, kInside);
    if (epsilon == kCulled || epsilon == kInside) return false;
    return allowedAt(epsilon, step) >= (h.isStochastic ? std::exp2(h.finestCode / 8.0) : slot.inputError);
}

/// What is drawn for an instance, and what the full cut of that costs, where it was worked out.
struct Choice {
    uint32_t instance;
    CutCost cost;
    bool isCounted;
};

/// The coarsest of an instance's proxies that is good enough, if it has fewer records than i itself; else i.
Choice chooseFor(const CutFrame& frame, uint32_t i, int step) {
    uint32_t best = i;
    for (uint32_t next = frame.instance(i).proxy; next != Instance::kNone && isGoodEnough(frame, next, step);
         next = frame.instance(next).proxy)
        best = next;
    if (best == i) return {i, {}, false};
    const Hierarchy& h = frame.hierarchyOf(i);
    if (h.isMesh()) {
        const CutCost own = costOf(frame, i, step, kNoLimit), proxy = costOf(frame, best, step, own.records);
        return proxy.records < own.records ? Choice{best, proxy, true} : Choice{i, own, true};
    }
    const CutCost proxy = costOf(frame, best, step, kNoLimit);
    // Its root alone has more: no need to look further. (But an overview may have fewer.)
    if (h.overviewOf(h.nodes[0]) == 0 && proxy.records <= h.nodes[0].records) return {best, proxy, true};
    const CutCost own = costOf(frame, i, step, proxy.records);
    return proxy.records <= own.records ? Choice{best, proxy, true} : Choice{i, own, true};
}

/// What instance i adds to the cut, with its proxies; those of its group's members that are to be drawn go to
/// `members`.
CutCost costOfBest(const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted,
                   ActiveMembers& members) {
    const Choice choice = chooseFor(frame, i, step);
    uint32_t best = choice.instance;
    if (counted == Counted::all && choice.isCounted && frame.instance(best).group == Instance::kNone)
        return choice.cost;
    if (counted == Counted::drawable && best != i && !frame.drawableOf(best)[0]) best = i;
    return costOf(frame, best, step, most, counted, &members);
}

}  // namespace

CutCost costOfCut(const CutFrame& frame, int step, uint64_t budget, Counted counted) {
    ActiveMembers members{frame.scratch.members};
    members.clear();
    CutCost total;
    const auto add = [&](uint32_t i) {
        if (total.records > budget) return;
        const CutCost cost = costOfBest(frame, i, step, budget - total.records, counted, members);
        total.records += cost.records;
        total.isWhole = total.isWhole && cost.isWhole;
    };
    for (const uint32_t i : frame.scratch.drivers) add(i);
    for (size_t k = 0; k < members.of.active.size() && total.records <= budget; ++k) add(members.of.active[k]);
    return total;
}

namespace {

void emitBest(const CutFrame& frame, uint32_t i, int step, ActiveMembers& members, Cut& cut) {
    uint32_t best = chooseFor(frame, i, step).instance;
    if (best != i && !frame.drawableOf(best)[0]) {  // asked for; meanwhile the instance itself is drawn
        cut.wanted.push_back({frame.instance(best).source, 0, 1e9f});
        best = i;
    }
    cut.counters.proxies += best != i ? 1 : 0;
    shapeOf(frame.hierarchyOf(best)).cutEmit(frame, best, step, members, cut);
}

/// Members of instance groups are drawn from one moment to the next: the roots of their stores are always wanted.
void wantRoots(const CutFrame& frame, Cut& cut) {
    for (const InstanceGroup& group : frame.scene.groups)
        for (const uint32_t source : group.sources)
            if (frame.residency.drawable[source][0])
                cut.keep.emplace_back(source, 0u);
            else
                cut.wanted.push_back({source, 0, 1e8f});
}

void emitCut(const CutFrame& frame, int step, Cut& cut) {
    wantRoots(frame, cut);
    ActiveMembers members{frame.scratch.members};
    members.clear();
    for (const uint32_t i : frame.scratch.drivers) emitBest(frame, i, step, members, cut);
    auto& active = members.of.active;
    cut.counters.groupMembers = active.size();
    std::sort(active.begin(), active.end());
    for (const uint32_t i : active) emitBest(frame, i, step, members, cut);
}

/// Even the coarsest cut is too large: leave out records, finest first, and say so.
void truncate(uint64_t budget, Cut& cut) {
    cut.truncated = true;
    uint64_t left = budget, triangles = 0;
    for (CutDraw& draw : cut.draw) {
        const uint64_t each = std::max(draw.triangles, 1u);
        draw.count = static_cast<uint32_t>(std::min<uint64_t>(draw.count, left / each));
        left -= draw.count * each;
        triangles += uint64_t{draw.count} * draw.triangles;
    }
    std::erase_if(cut.draw, [](const CutDraw& d) { return d.count == 0; });
    cut.counters.recordsDrawn = budget - left - triangles;
    left += triangles;  // those of meshes are counted with them
    std::erase_if(cut.meshDraw, [&](const CutMeshDraw& d) {
        const bool isLeftOut = triangles + d.triangles > left;
        if (!isLeftOut) triangles += d.triangles;
        return isLeftOut;
    });
    cut.counters.trianglesDrawn = triangles;
}

/// So that nothing below the node is looked at, and what is drawn of it counts as exact.
void allowAnyError(const CutFrame& frame, const PlacedNode& n) {
    const Hierarchy& h = frame.hierarchyOf(n.instance);
    const CutScratch::Slot& slot = slotOf(frame, n.instance);
    if (epsilonOf(frame, h, slot, n.node, kInside) != kCulled)
        frame.scratch.allowed[slot.first + n.node].epsilon = kAnyError;
}

double tauAt(int step, int target, double tau) {
    return step == target ? tau : std::exp2(static_cast<double>(step) / kStepsPerOctave);
}

}  // namespace

void beginCut(const CutFrame& frame, std::span<const PlacedNode> unrefined, Cut& cut) {
    cut.draw.clear();
    cut.meshDraw.clear();
    cut.wanted.clear();
    cut.keep.clear();
    cut.counters = {};
    cut.truncated = false;
    cut.tauEffective = 0;
    CutScratch& scratch = frame.scratch;
    ++scratch.frame;
    scratch.slotsUsed = 0;
    scratch.allowedUsed = 0;
    if (scratch.slotOf.size() != frame.scene.instances.size()) findDrivers(frame);
    scratch.isReady.clear();
    for (const InstanceGroup& group : frame.scene.groups) scratch.isReady.push_back(isReady(frame, group) ? 1 : 0);
    for (const PlacedNode& n : unrefined) allowAnyError(frame, n);
}

void emitCutAt(const CutFrame& frame, const PlannedStep& step, const Target& target, uint64_t budget, Cut& cut) {
    cut.tauTarget = tauAt(step.planned, target.step, target.tau);
    emitCut(frame, step.planned, cut);
    if (step.drawn != step.planned) {
        // Wanted and kept is what the full cut needs, or what is drawn meanwhile would stay.
        const size_t wanted = cut.wanted.size(), keep = cut.keep.size();
        const uint64_t missing = cut.counters.nodesMissing, evaluations = cut.counters.evaluations;
        cut.draw.clear();
        cut.meshDraw.clear();
        cut.counters = {};
        cut.tauEffective = 0;
        emitCut(frame, step.drawn, cut);
        cut.wanted.resize(wanted);
        cut.keep.resize(keep);
        cut.counters.nodesMissing = missing;
        cut.counters.evaluations = evaluations;
    }
    cut.tauEffective = std::max(cut.tauEffective, tauAt(step.drawn, target.step, target.tau));
    if (cut.counters.recordsDrawn + cut.counters.trianglesDrawn > budget) truncate(budget, cut);
    cut.counters.nodesDrawn += cut.draw.size();
}

void selectCut(const CutScene& scene, const Residency& residency, const View& view, const Budgets& budgets,
               CutScratch& scratch, Cut& cut) {
    const CutFrame frame{scene, residency, view, scratch};
    beginCut(frame, budgets.unrefined, cut);
    const Target target(budgets.errorPixels);
    const auto cost = [&](int step, uint64_t most, Counted counted) { return costOfCut(frame, step, most, counted); };
    const PlannedStep step = planStep(cost, target.step, budgets.records, cut.counters);
    emitCutAt(frame, step, target, budgets.records, cut);
}

}  // namespace stipple::lod
