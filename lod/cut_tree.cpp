// The cut of an octree: from the root down, as far as errors are too large. What it has of a node, each payload's kind
// knows (Asked).
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
void walkTree(const CutFrame& frame, uint32_t i, int step, const OnCulled& onCulled, const IsReached& isReached,
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
        if (h.errorCodeOf(index) <= code || !isReached(index)) continue;
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
    }
}

/// Can all payloads of a node be drawn?
bool isThere(const Hierarchy& h, const std::vector<uint8_t>& drawable, uint32_t node) {
    if (h.further.empty()) return drawable[node] != 0;
    bool all = true;
    h.forEachPayload(node, [&](uint32_t chunk) { all = all && drawable[chunk] != 0; });
    return all;
}

/// Octants of children that are in view and cannot be drawn.
uint32_t missingOctants(const CutFrame& frame, const Hierarchy& h, const CutScratch::Slot& slot,
                        const std::vector<uint8_t>& drawable, const OnTheWay& at) {
    const Node& node = h.nodes[at.index];
    if (h.errorCodeOf(at.index) <= at.code) return 0;
    uint32_t mask = 0, child = node.firstChild;
    for (uint32_t octant = 0; octant < 8; ++octant) {
        if (!(node.childMask >> octant & 1u)) continue;
        // A child out of view is not drawn and not missing either.
        if (!isThere(h, drawable, child) && epsilonOf(frame, h, slot, child, at.epsilon) != kCulled)
            mask |= 1u << octant;
        ++child;
    }
    return mask;
}

/// True if every ancestor is drawable (a child whose parent's chunk is missing is covered by a coarser ancestor).
bool hangsTogether(const std::vector<uint8_t>& drawable, const Hierarchy& h, uint32_t index) {
    while (index != 0) {
        index = h.nodes[index].parent;
        if (!isThere(h, drawable, index)) return false;
    }
    return true;
}

/// What a view asks of a node's payloads.
Asked askedOf(const OnTheWay& at, uint32_t octantMask, uint32_t largest) {
    return {at.code, at.parentCode, octantMask, at.epsilon, largest};
}

}  // namespace

CutCost costOfTree(const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted,
                   ActiveMembers* /*members*/) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    CutCost cost;
    const auto add = [&](const OnTheWay& at, uint32_t octantMask) {
        const Asked asked = askedOf(at, octantMask, ErrorScale::kLargest);
        h.forEachPayload(at.index,
                         [&](uint32_t chunk) { cost.records += traitsOf(kindOf(h, chunk)).cutCost(h, chunk, asked); });
        return cost.records <= most;
    };
    if (counted == Counted::all) {
        walkTree(
            frame, i, step, [] {}, [](uint32_t) { return true; },
            [&](const OnTheWay& at) {
                cost.isWhole = cost.isWhole && isThere(h, drawable, at.index);
                return add(at, 0);
            });
        return cost;
    }
    const CutScratch::Slot& slot = slotOf(frame, i);
    const auto isReached = [&](uint32_t index) { return isThere(h, drawable, index); };
    walkTree(
        frame, i, step, [] {}, isReached,
        [&](const OnTheWay& at) {
            cost.isWhole = cost.isWhole && isReached(at.index);
            return !isReached(at.index) || add(at, missingOctants(frame, h, slot, drawable, at));
        });
    return cost;
}

void emitTree(const CutFrame& frame, uint32_t i, int step, ActiveMembers& /*members*/, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const uint32_t source = frame.instance(i).source, largest = largestAllowed(h);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    const size_t firstDraw = cut.draw.size(), firstMesh = cut.meshDraw.size();
    const auto onCulled = [&] {
        ++cut.counters.nodesVisited;
        ++cut.counters.nodesCulled;
    };
    const auto priorityOf = [&](const OnTheWay& at) {
        const Node& node = h.nodes[at.index];
        const double pixels = at.index == 0 ? 1e9 : pixelsOf(slot, h.errorCodeOf(node.parent), at.parentEpsilon);
        return static_cast<float>(pixels * std::exp2(8.0 - node.level));
    };
    const auto take = [&](const OnTheWay& at) {
        ++cut.counters.nodesVisited;
        bool isWhole = true;
        h.forEachPayload(at.index, [&](uint32_t chunk) {
            if (drawable[chunk]) {
                cut.keep.emplace_back(source, chunk);
                return;
            }
            isWhole = false;
            cut.wanted.push_back({source, chunk, priorityOf(at)});
        });
        cut.counters.nodesMissing += isWhole ? 0 : 1;
        // Only what hangs together with the root is drawn: a node whose parent is missing is covered above.
        if (!isWhole || !hangsTogether(drawable, h, at.index)) return true;
        const Asked asked = askedOf(at, missingOctants(frame, h, slot, drawable, at), largest);
        h.forEachPayload(at.index,
                         [&](uint32_t chunk) { traitsOf(kindOf(h, chunk)).cutEmit(frame, i, chunk, asked, cut); });
        return true;
    };
    walkTree(
        frame, i, step, onCulled, [](uint32_t) { return true; }, take);
    std::sort(
        cut.draw.begin() + static_cast<std::ptrdiff_t>(firstDraw), cut.draw.end(),
        [](const CutDraw& a, const CutDraw& b) { return a.node != b.node ? a.node < b.node : a.chunk < b.chunk; });
    std::sort(cut.meshDraw.begin() + static_cast<std::ptrdiff_t>(firstMesh), cut.meshDraw.end(),
              [](const CutMeshDraw& a, const CutMeshDraw& b) {
                  if (a.node != b.node) return a.node < b.node;
                  return a.chunk != b.chunk ? a.chunk < b.chunk : a.firstCluster < b.firstCluster;
              });
}

}  // namespace stipple::lod
