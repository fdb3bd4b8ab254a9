// The cut of points and curves: of each node a beginning of its records, without those that its children replace.
#include <algorithm>

#include "lod/cut_frame.h"

namespace stipple::lod {
namespace {

/// The largest code of an error that a view may allow. Where the scale ends below twice the diagonal of the root, the
/// last code stands for whatever is larger.
uint32_t largestAllowed(const Hierarchy& h) {
    const bool isWhole = h.errors.decode(ErrorScale::kLargest) >= 3.4 * std::exp2(static_cast<double>(h.rootLog2));
    return isWhole ? ErrorScale::kLargest : ErrorScale::kLargest - 1;
}

/// Allowed own error of records: what the input's error leaves of the whole.
uint32_t codeOf(const CutScratch::Slot& slot, int32_t epsilon, int step) {
    if (slot.inputError == 0) return codeAt(epsilon, step);
    const double left = allowedAt(epsilon, step) - slot.inputError;
    if (!(left >= 1)) return 0;
    return static_cast<uint32_t>(std::min(8 * std::log2(left), double{ErrorScale::kLargest}));
}

/// A node on the way down from the root.
struct OnTheWay {
    uint32_t index;
    int32_t epsilon, parentEpsilon;
    uint32_t code, parentCode;
};

/// Calls use(at) for every node in view that any record may be drawn of, parents first; it says whether to go on.
/// onCulled(): of one out of view. `isReached(node)`: may its children be looked at?
template <typename OnCulled, typename IsReached, typename Use>
void walkPoints(const CutFrame& frame, uint32_t i, int step, const OnCulled& onCulled, const IsReached& isReached,
                const Use& use) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    const uint32_t largest = largestAllowed(h);
    auto& stack = frame.scratch.stack;
    stack.assign(1, 0u);
    while (!stack.empty()) {
        const uint32_t index = stack.back();
        stack.pop_back();
        const Node& node = h.nodes[index];
        const int32_t parentEpsilon = index == 0 ? kInside : epsilonAt(frame, slot, node.parent);
        const int32_t epsilon = epsilonOf(frame, h, slot, index, parentEpsilon);
        if (epsilon == kCulled) {
            onCulled();
            continue;
        }
        const uint32_t parentCode =
            index == 0 ? ErrorScale::kLargest : std::min(codeOf(slot, parentEpsilon, step), largest);
        const uint32_t code = std::min(codeOf(slot, epsilon, step), largest);
        if (!use(OnTheWay{index, epsilon, parentEpsilon, code, parentCode})) return;
        if (node.errorCode <= code || !isReached(index)) continue;
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
    }
}

/// Octants of children that are in view and cannot be drawn.
uint32_t missingOctants(const CutFrame& frame, const Hierarchy& h, const CutScratch::Slot& slot,
                        const std::vector<uint8_t>& drawable, const OnTheWay& at) {
    const Node& node = h.nodes[at.index];
    if (node.errorCode <= at.code) return 0;
    uint32_t mask = 0, child = node.firstChild;
    for (uint32_t octant = 0; octant < 8; ++octant) {
        if (!(node.childMask >> octant & 1u)) continue;
        // A child out of view is not drawn and not missing either.
        if (!drawable[child] && epsilonOf(frame, h, slot, child, at.epsilon) != kCulled) mask |= 1u << octant;
        ++child;
    }
    return mask;
}

/// Of a node: the first records that are looked at, and those among them that are left to the children.
struct Prefix {
    uint32_t count, tooCoarse;
};
Prefix prefixOf(const Hierarchy& h, const OnTheWay& at, uint32_t octantMask) {
    const Node& node = h.nodes[at.index];
    return {h.countGreater(node.parentCounts, node.records, at.parentCode),
            octantMask != 0 ? 0 : h.countGreater(node.ownCounts, node.records, at.code)};
}

/// True if every ancestor is drawable (a child whose parent's chunk is missing is covered by a coarser ancestor).
bool hangsTogether(const std::vector<uint8_t>& drawable, const Hierarchy& h, uint32_t index) {
    while (index != 0) {
        index = h.nodes[index].parent;
        if (!drawable[index]) return false;
    }
    return true;
}

}  // namespace

CutCost costOfPoints(const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted,
                     ActiveMembers* members) {
    const Hierarchy& h = frame.hierarchyOf(i);
    if (h.isProgressive) return costOfProgressive(frame, i, step, most, counted, members);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    CutCost cost;
    const auto add = [&](const OnTheWay& at, uint32_t octantMask) {
        const Prefix prefix = prefixOf(h, at, octantMask);
        cost.records += prefix.count - prefix.tooCoarse;
        return cost.records <= most;
    };
    if (counted == Counted::all) {
        walkPoints(
            frame, i, step, [] {}, [](uint32_t) { return true; },
            [&](const OnTheWay& at) {
                cost.isWhole = cost.isWhole && drawable[at.index] != 0;
                return add(at, 0);
            });
        return cost;
    }
    const CutScratch::Slot& slot = slotOf(frame, i);
    const auto isThere = [&](uint32_t index) { return drawable[index] != 0; };
    walkPoints(
        frame, i, step, [] {}, isThere,
        [&](const OnTheWay& at) {
            cost.isWhole = cost.isWhole && isThere(at.index);
            return !isThere(at.index) || add(at, missingOctants(frame, h, slot, drawable, at));
        });
    return cost;
}

void emitPoints(const CutFrame& frame, uint32_t i, int step, ActiveMembers& members, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    if (h.isProgressive) return emitProgressive(frame, i, step, members, cut);
    const uint32_t source = frame.instance(i).source, largest = largestAllowed(h);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    const size_t firstDraw = cut.draw.size();
    const auto onCulled = [&] {
        ++cut.counters.nodesVisited;
        ++cut.counters.nodesCulled;
    };
    const auto want = [&](const OnTheWay& at) {
        ++cut.counters.nodesMissing;
        const Node& node = h.nodes[at.index];
        const double pixels = at.index == 0 ? 1e9 : pixelsOf(slot, h.nodes[node.parent].errorCode, at.parentEpsilon);
        cut.wanted.push_back({source, at.index, static_cast<float>(pixels * std::exp2(8.0 - node.level))});
    };
    const auto take = [&](const OnTheWay& at) {
        ++cut.counters.nodesVisited;
        if (!drawable[at.index]) {
            want(at);
            return true;
        }
        cut.keep.emplace_back(source, at.index);
        // Only what hangs together with the root is drawn: a node whose parent is missing is covered above.
        if (!hangsTogether(drawable, h, at.index)) return true;
        const uint32_t octantMask = missingOctants(frame, h, slot, drawable, at);
        const auto [count, tooCoarse] = prefixOf(h, at, octantMask);
        if (count == 0) return true;
        cut.counters.recordsDrawn += count - tooCoarse;
        cut.counters.recordsTested += count;
        const uint32_t errorCode = h.nodes[at.index].errorCode;
        const uint32_t drawnCode = octantMask ? errorCode : std::min<uint32_t>(errorCode, at.code);
        const double delivered = pixelsOf(slot, drawnCode, drawnCode > largest ? kInside : at.epsilon);
        if (octantMask) cut.tauEffective = std::max(cut.tauEffective, delivered);
        if (count > tooCoarse)
            cut.draw.push_back({i, at.index, count, at.code, octantMask, static_cast<float>(delivered)});
        return true;
    };
    walkPoints(
        frame, i, step, onCulled, [](uint32_t) { return true; }, take);
    std::sort(cut.draw.begin() + static_cast<std::ptrdiff_t>(firstDraw), cut.draw.end(),
              [](const CutDraw& a, const CutDraw& b) { return a.node < b.node; });
}

}  // namespace stipple::lod
