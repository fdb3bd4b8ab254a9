// The cut of stochastic points: the first records of a node, as many as their discs have to be small. A node that is
// too coarse even with all of them gives way to its children, a leaf that shows an instance group to its members.
#include <algorithm>

#include "lod/cut/frame.h"

namespace stipple::lod {
namespace {

/// What to do with a node of a stochastic store.
struct Progress {
    enum class Kind { unseen, drawn, members, children } kind = Kind::unseen;
    uint32_t count = 0;  ///< drawn: first records
    double pixels = 0;   ///< drawn: error
};

Progress progressOf(const CutFrame& frame, uint32_t i, const CutScratch::Slot& slot, uint32_t index, int step) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const Node& node = h.nodes[index];
    const int32_t parentEpsilon = index == 0 ? kInside : epsilonAt(frame, slot, node.parent);
    const int32_t epsilon = epsilonOf(frame, h, slot, index, parentEpsilon);
    if (epsilon == kCulled) return {};
    const uint32_t group = frame.instance(i).group;
    // What all of them are off by leaves the rest to the size of the discs.
    const double radius = std::exp2(node.errorCode / 8.0), allowed = allowedAt(epsilon, step) - slot.inputError;
    Progress p;
    if (allowed >= radius) {  // the area of n discs of radius r stays the same: n r^2 = records * radius^2
        const double count = std::ceil(node.records * (radius / allowed) * (radius / allowed));
        p.count = static_cast<uint32_t>(std::clamp(count, 1.0, static_cast<double>(node.records)));
    } else if (!node.isLeaf()) {
        p.kind = Progress::Kind::children;
        return p;
    } else if (group != Instance::kNone && frame.scratch.isReady[group]) {
        p.kind = Progress::Kind::members;
        return p;
    } else {
        p.count = node.records;
    }
    p.kind = Progress::Kind::drawn;
    const double larger = std::sqrt(static_cast<double>(node.records) / p.count);
    p.pixels = pixelsOf(slot, node.errorCode, epsilon, larger);
    return p;
}

/// Are the children of a node that must be drawn in its place there? Calls onMissing(child) for those that are not.
template <typename OnMissing>
bool hasChildren(const CutFrame& frame, uint32_t i, const CutScratch::Slot& slot, uint32_t index, int step,
                 const OnMissing& onMissing) {
    const Node& node = frame.hierarchyOf(i).nodes[index];
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    bool isComplete = true;
    const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
    for (uint32_t child = node.firstChild; child < node.firstChild + children; ++child) {
        const Progress of = progressOf(frame, i, slot, child, step);
        if (of.kind == Progress::Kind::unseen || of.kind == Progress::Kind::members || drawable[child]) continue;
        isComplete = false;
        onMissing(child);
    }
    return isComplete;
}

/// What a walk does after a node: looks at its children where it gives way to them, goes on beside it, or ends.
enum class Next { inside, beside, end };

/// Calls use(index, progress) for every node that is looked at, parents first.
template <typename Use>
void walkStochastic(const CutFrame& frame, uint32_t i, int step, const Use& use) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    auto& stack = frame.scratch.stack;
    stack.assign(1, 0u);
    while (!stack.empty()) {
        const uint32_t index = stack.back();
        stack.pop_back();
        const Progress p = progressOf(frame, i, slot, index, step);
        const Next next = use(index, p);
        if (next == Next::end) return;
        if (next == Next::beside || p.kind != Progress::Kind::children) continue;
        const auto children = static_cast<uint32_t>(__builtin_popcount(h.nodes[index].childMask));
        for (uint32_t c = 0; c < children; ++c) stack.push_back(h.nodes[index].firstChild + c);
    }
}

}  // namespace

CutCost costOfStochastic(const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted,
                         ActiveMembers* members) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    CutCost cost;
    walkStochastic(frame, i, step, [&](uint32_t index, const Progress& p) {
        if (p.kind == Progress::Kind::unseen) return Next::beside;
        if (p.kind == Progress::Kind::members) {
            if (members) members->activate(frame.scene.groups[frame.instance(i).group], index);
            return Next::beside;
        }
        cost.isWhole = cost.isWhole && drawable[index] != 0;
        uint32_t count = p.count;
        Next next = Next::inside;
        if (counted == Counted::drawable) {
            if (!drawable[index]) return Next::beside;
            if (p.kind == Progress::Kind::children && !hasChildren(frame, i, slot, index, step, [](uint32_t) {})) {
                count = h.nodes[index].records;
                next = Next::beside;
            }
        }
        cost.records += count;
        return cost.records > most ? Next::end : next;
    });
    return cost;
}

void emitStochastic(const CutFrame& frame, uint32_t i, int step, ActiveMembers& members, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    const uint32_t source = frame.instance(i).source;
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    const size_t firstDraw = cut.draw.size();
    const auto want = [&](uint32_t index, double pixels) {
        ++cut.counters.nodesMissing;
        const double priority = index == 0 ? 1e9 : pixels * std::exp2(8.0 - h.nodes[index].level);
        cut.wanted.push_back({source, index, static_cast<float>(priority)});
    };
    const auto draw = [&](uint32_t index, uint32_t count, double pixels) {
        const double larger = std::sqrt(static_cast<double>(h.nodes[index].records) / count);
        const double radius = std::exp2(h.nodes[index].errorCode / 8.0) * h.errors.smallest;
        const auto scale = static_cast<float>(larger) * h.discFactor(radius * larger);
        cut.draw.push_back({i, index, index, 0, count, ErrorScale::kNoParent, 0, static_cast<float>(pixels), scale});
        cut.counters.recordsDrawn += count;
        cut.counters.recordsTested += count;
        // Of a node that is drawn whole and too coarse all the same.
        if (count == h.nodes[index].records) cut.tauEffective = std::max(cut.tauEffective, pixels);
    };
    walkStochastic(frame, i, step, [&](uint32_t index, const Progress& p) {
        ++cut.counters.nodesVisited;
        if (p.kind == Progress::Kind::unseen) {
            ++cut.counters.nodesCulled;
            return Next::beside;
        }
        if (p.kind == Progress::Kind::members) {
            members.activate(frame.scene.groups[frame.instance(i).group], index);
            return Next::beside;
        }
        if (!drawable[index]) {  // only the root comes here: of children it is known before
            want(index, p.pixels);
            return Next::beside;
        }
        cut.keep.emplace_back(source, index);
        if (p.kind == Progress::Kind::drawn) {
            draw(index, p.count, p.pixels);
            return Next::beside;
        }
        // All children or none: a node stands for all of its space.
        const double pixels = pixelsOf(slot, h.nodes[index].errorCode, epsilonAt(frame, slot, index));
        const auto onMissing = [&](uint32_t child) { want(child, pixels); };
        if (hasChildren(frame, i, slot, index, step, onMissing)) return Next::inside;
        draw(index, h.nodes[index].records, pixels);
        return Next::beside;
    });
    std::sort(cut.draw.begin() + static_cast<std::ptrdiff_t>(firstDraw), cut.draw.end(),
              [](const CutDraw& a, const CutDraw& b) { return a.node < b.node; });
}

}  // namespace stipple::lod
