// The cut of progressive stores: the first records of a node, as many as their discs have to be small. A node that is
// too coarse even with all of them gives way to its children, a leaf that shows a crowd to the crowd's members.
#include <algorithm>
#include <cmath>

#include "lod/selector.h"

namespace stipple::lod {

Selector::Progress Selector::progressOf(size_t i, CutScratch::Slot& slot, uint32_t index, int step) {
    const Node& node = hierarchyOf(i).nodes[index];
    const int32_t parentEpsilon = index == 0 ? kInside : slot.epsilon[node.parent];
    const int32_t epsilon = epsilonOf(i, slot, index, parentEpsilon);
    if (epsilon == kCulled) return {};
    const double radius = std::exp2(node.errorCode / 8.0), allowed = allowedAt(epsilon, step);
    Progress p;
    if (allowed >= radius) {  // the area of n discs of radius r stays the same: n r^2 = records * radius^2
        const double count = std::ceil(node.records * (radius / allowed) * (radius / allowed));
        p.count = static_cast<uint32_t>(std::clamp(count, 1.0, static_cast<double>(node.records)));
    } else if (!node.isLeaf()) {
        p.kind = Progress::Kind::children;
        return p;
    } else if (instances_[i].crowd != Instance::kNone && isReady_[instances_[i].crowd]) {
        p.kind = Progress::Kind::members;
        return p;
    } else {
        p.count = node.records;
    }
    p.kind = Progress::Kind::drawn;
    p.pixels = pixelsOf(slot, node.errorCode, epsilon) * std::sqrt(static_cast<double>(node.records) / p.count);
    return p;
}

uint64_t Selector::progressiveCost(size_t i, int step, uint64_t most) {
    const Hierarchy& h = hierarchyOf(i);
    CutScratch::Slot& slot = slotOf(i);
    uint64_t total = 0;
    auto& stack = scratch_.stack;
    stack.assign(1, 0u);
    while (!stack.empty() && total <= most) {
        const uint32_t index = stack.back();
        stack.pop_back();
        const Progress p = progressOf(i, slot, index, step);
        total += p.count;
        if (p.kind == Progress::Kind::members) activate(crowds_[instances_[i].crowd], index);
        if (p.kind != Progress::Kind::children) continue;
        for (int c = 0; c < __builtin_popcount(h.nodes[index].childMask); ++c)
            stack.push_back(h.nodes[index].firstChild + static_cast<uint32_t>(c));
    }
    return total;
}

void Selector::emitProgressive(uint32_t i, int step) {
    const Hierarchy& h = hierarchyOf(i);
    CutScratch::Slot& slot = slotOf(i);
    const uint32_t source = instances_[i].source;
    const std::vector<uint8_t>& drawable = residency_.drawable[source];
    const size_t firstDraw = cut_.draw.size();
    const auto want = [&](uint32_t index, double pixels) {
        ++cut_.counters.nodesMissing;
        const double priority = index == 0 ? 1e9 : pixels * std::exp2(8.0 - h.nodes[index].level);
        cut_.wanted.push_back({source, index, static_cast<float>(priority)});
    };
    const auto draw = [&](uint32_t index, uint32_t count, double pixels) {
        const double larger = std::sqrt(static_cast<double>(h.nodes[index].records) / count);
        const double radius = std::exp2(h.nodes[index].errorCode / 8.0) * h.errors.smallest;
        const auto scale = static_cast<float>(larger) * h.discFactor(radius * larger);
        cut_.draw.push_back({i, index, count, ErrorScale::kNoParent, 0, static_cast<float>(pixels), scale});
        cut_.counters.recordsDrawn += count;
        cut_.counters.recordsTested += count;
    };
    auto& stack = scratch_.stack;
    stack.assign(1, 0u);
    while (!stack.empty()) {
        const uint32_t index = stack.back();
        stack.pop_back();
        const Node& node = h.nodes[index];
        ++cut_.counters.nodesVisited;
        const Progress p = progressOf(i, slot, index, step);
        if (p.kind == Progress::Kind::unseen) {
            ++cut_.counters.nodesCulled;
            continue;
        }
        if (p.kind == Progress::Kind::members) {
            activate(crowds_[instances_[i].crowd], index);
            continue;
        }
        if (!drawable[index]) {  // only the root comes here: of children it is known before
            want(index, p.pixels);
            continue;
        }
        cut_.keep.emplace_back(source, index);
        if (p.kind == Progress::Kind::drawn) {
            draw(index, p.count, p.pixels);
            // Of a node that is drawn whole and too coarse all the same.
            if (p.count == node.records) cut_.tauEffective = std::max(cut_.tauEffective, p.pixels);
            continue;
        }
        // All children or none: a node stands for all of its space.
        bool isComplete = true;
        const double pixels = pixelsOf(slot, node.errorCode, slot.epsilon[index]);
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t child = node.firstChild; child < node.firstChild + children; ++child) {
            const Progress of = progressOf(i, slot, child, step);
            if (of.kind == Progress::Kind::unseen || of.kind == Progress::Kind::members || drawable[child]) continue;
            isComplete = false;
            want(child, pixels);
        }
        if (!isComplete) {
            draw(index, node.records, pixels);
            cut_.tauEffective = std::max(cut_.tauEffective, pixels);
            continue;
        }
        for (uint32_t child = node.firstChild; child < node.firstChild + children; ++child) stack.push_back(child);
    }
    std::sort(cut_.draw.begin() + static_cast<std::ptrdiff_t>(firstDraw), cut_.draw.end(),
              [](const CutDraw& a, const CutDraw& b) { return a.node < b.node; });
}

// ---- crowds ----

bool Selector::isReady(const Crowd& crowd) const {
    return std::all_of(crowd.sources.begin(), crowd.sources.end(),
                       [&](uint32_t source) { return residency_.drawable[source][0] != 0; });
}
void Selector::wantRoots() {
    for (size_t c = 0; c < crowds_.size(); ++c)
        for (const uint32_t source : crowds_[c].sources)
            if (residency_.drawable[source][0])
                cut_.keep.emplace_back(source, 0u);
            else
                cut_.wanted.push_back({source, 0, 1e8f});
}
void Selector::beginEvaluation() {
    ++scratch_.evaluation;
    scratch_.active.clear();
}
void Selector::activate(const Crowd& crowd, uint32_t index) {
    for (uint32_t k = crowd.first[index]; k < crowd.first[index + 1]; ++k) {
        const uint32_t member = crowd.members[k];
        if (scratch_.activeStamp[member] == scratch_.evaluation) continue;
        scratch_.activeStamp[member] = scratch_.evaluation;
        scratch_.active.push_back(member);
    }
}

}  // namespace stipple::lod
