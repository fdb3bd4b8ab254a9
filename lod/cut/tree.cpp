// The cut of an octree: from the root down, as far as errors are too large. What it has of a node, each payload's kind
// knows (Asked).
#include <algorithm>

#include "lod/cut/frame.h"

namespace stipple::lod {
namespace {

// What a walk asks of the payloads of nodes, whatever they are ...
struct AnyPayloads {
    const Hierarchy& h;
    uint32_t errorCode(uint32_t node) const { return h.errorCodeOf(node); }
    template <typename Use>
    void forEach(uint32_t node, const Use& use) const {
        h.forEachPayload(node, use);
    }
    uint64_t cost(uint32_t node, const Asked& asked) const {
        uint64_t records = 0;
        forEach(node, [&](uint32_t chunk) { records += traitsOf(kindOf(h, chunk)).cutCost(h, chunk, asked); });
        return records;
    }
    void emit(const CutFrame& frame, const CutScratch::Slot&, uint32_t i, uint32_t node, const Asked& asked,
              Cut& cut) const {
        forEach(node, [&](uint32_t chunk) { traitsOf(kindOf(h, chunk)).cutEmit(frame, i, chunk, asked, cut); });
    }
};
/// ... and where every node has one, of records: the same, without asking the table of kinds at each node.
struct OneOfRecords {
    const Hierarchy& h;
    static bool isAll(const Hierarchy& h) { return !h.isMixed && traitsOf(h.nodes[0].kind).cutEmit == emitRecords; }
    uint32_t errorCode(uint32_t node) const { return h.nodes[node].errorCode; }
    template <typename Use>
    void forEach(uint32_t node, const Use& use) const {
        use(node);
    }
    uint64_t cost(uint32_t node, const Asked& asked) const { return prefixOf(h, h.nodes[node], asked).drawn(); }
    void emit(const CutFrame&, const CutScratch::Slot& slot, uint32_t i, uint32_t node, const Asked& asked,
              Cut& cut) const {
        appendRecords(slot, h, i, node, node, h.nodes[node], asked, cut);
    }
};

/// Can all payloads of a node be drawn?
template <typename Payloads>
bool isThere(const Payloads& of, const std::vector<uint8_t>& drawable, uint32_t node) {
    bool all = true;
    of.forEach(node, [&](uint32_t chunk) { all = all && drawable[chunk] != 0; });
    return all;
}

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

/// Of a node that is not refined: all that its records may be. A root is drawn as what it holds itself, for where it is
/// hidden what that hides is known, or as coarser as it may be anyway.
template <typename Payloads>
uint32_t codeOfUnrefined(const Payloads& of, const CutScratch::Slot& slot, const Hierarchy& h, uint32_t node,
                         int step) {
    if (node != 0) return ErrorScale::kLargest;
    const int32_t epsilon = allowedError(h, h.nodes[0], slot.view, slot.sway);
    const uint32_t allowed = epsilon == kCulled ? 0 : std::min(codeOf(slot, epsilon, step), largestAllowed(h));
    return std::max(of.errorCode(0), allowed);
}

/// Calls use(at) for every node in view that any record may be drawn of, parents first; it says whether to go on.
/// onCulled(): of one out of view. `isReached(node)`: may its children be looked at?
template <typename Payloads, typename OnCulled, typename IsReached, typename Use>
void walkTree(const Payloads& of, const CutFrame& frame, uint32_t i, int step, const OnCulled& onCulled,
              const IsReached& isReached, const Use& use) {
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
        // (What is above the root's own records is its overview, in the same payload.)
        uint32_t code = epsilon == kAnyError ? codeOfUnrefined(of, slot, h, index, step)
                                             : std::min(codeOf(slot, epsilon, step), largest);
        if (index == 0 && frame.hasNoOverviews) code = std::min(code, of.errorCode(0));
        const uint32_t parentCode = index == 0 ? code : std::min(codeOf(slot, parentEpsilon, step), largest);
        if (!use(OnTheWay{index, epsilon, parentEpsilon, code, parentCode})) return;
        if (of.errorCode(index) <= code || !isReached(index) || !h.hasChildrenOf(node)) continue;
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = 0; c < children; ++c) stack.push_back(node.firstChild + c);
    }
}

/// Octants of children that are in view and cannot be drawn (of children that are not known: all).
template <typename Payloads>
uint32_t missingOctants(const Payloads& of, const CutFrame& frame, const Hierarchy& h, const CutScratch::Slot& slot,
                        const std::vector<uint8_t>& drawable, const OnTheWay& at) {
    const Node& node = h.nodes[at.index];
    if (of.errorCode(at.index) <= at.code) return 0;
    if (!h.hasChildrenOf(node)) return node.childMask;
    uint32_t mask = 0, child = node.firstChild;
    for (uint32_t octant = 0; octant < 8; ++octant) {
        if (!(node.childMask >> octant & 1u)) continue;
        // A child out of view is not drawn and not missing either.
        if (!isThere(of, drawable, child) && epsilonOf(frame, h, slot, child, at.epsilon) != kCulled)
            mask |= 1u << octant;
        ++child;
    }
    return mask;
}

/// True if every ancestor is drawable (a child whose parent's chunk is missing is covered by a coarser ancestor).
template <typename Payloads>
bool hangsTogether(const Payloads& of, const std::vector<uint8_t>& drawable, const Hierarchy& h, uint32_t index) {
    while (index != 0) {
        index = h.nodes[index].parent;
        if (!isThere(of, drawable, index)) return false;
    }
    return true;
}

/// What a view asks of a node's payloads.
Asked askedOf(const OnTheWay& at, uint32_t octantMask, uint32_t largest) {
    return {at.code, at.parentCode, octantMask, at.epsilon, largest};
}

template <typename Payloads>
CutCost costOfWalk(const Payloads& of, const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    CutCost cost;
    const auto add = [&](const OnTheWay& at, uint32_t octantMask) {
        cost.records += of.cost(at.index, askedOf(at, octantMask, ErrorScale::kLargest));
        return cost.records <= most;
    };
    if (counted == Counted::all) {
        walkTree(
            of, frame, i, step, [] {}, [](uint32_t) { return true; },
            [&](const OnTheWay& at) {
                cost.isWhole = cost.isWhole && isThere(of, drawable, at.index) &&
                               (h.hasChildrenOf(h.nodes[at.index]) || of.errorCode(at.index) <= at.code);
                return add(at, 0);
            });
        return cost;
    }
    const CutScratch::Slot& slot = slotOf(frame, i);
    const auto isReached = [&](uint32_t index) { return isThere(of, drawable, index); };
    walkTree(
        of, frame, i, step, [] {}, isReached,
        [&](const OnTheWay& at) {
            cost.isWhole = cost.isWhole && isReached(at.index);
            return !isReached(at.index) || add(at, missingOctants(of, frame, h, slot, drawable, at));
        });
    return cost;
}

template <typename Payloads>
void emitWalk(const Payloads& of, const CutFrame& frame, uint32_t i, int step, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const uint32_t source = frame.instance(i).source, largest = largestAllowed(h);
    const std::vector<uint8_t>& drawable = frame.drawableOf(i);
    const CutScratch::Slot& slot = slotOf(frame, i);
    const auto onCulled = [&] {
        ++cut.counters.nodesVisited;
        ++cut.counters.nodesCulled;
    };
    const auto priorityOf = [&](const OnTheWay& at) {
        const Node& node = h.nodes[at.index];
        const double pixels = at.index == 0 ? 1e9 : pixelsOf(slot, of.errorCode(node.parent), at.parentEpsilon);
        return static_cast<float>(pixels * std::exp2(8.0 - node.level));
    };
    const auto take = [&](const OnTheWay& at) {
        ++cut.counters.nodesVisited;
        bool isWhole = true;
        of.forEach(at.index, [&](uint32_t chunk) {
            if (drawable[chunk]) {
                cut.keep.emplace_back(source, chunk);
                return;
            }
            isWhole = false;
            cut.wanted.push_back({source, chunk, priorityOf(at)});
        });
        cut.counters.nodesMissing += isWhole ? 0 : 1;
        if (const Node& node = h.nodes[at.index]; of.errorCode(at.index) > at.code && !h.hasChildrenOf(node)) {
            const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
            const auto pixels = static_cast<float>(pixelsOf(slot, of.errorCode(at.index), at.epsilon) *
                                                   std::exp2(8.0 - node.level - 1));
            for (uint32_t child = node.firstChild; child < node.firstChild + children; ++child)
                if (!h.known.hasNode(child)) cut.wanted.push_back({source, child, pixels});
            ++cut.counters.nodesMissing;
        }
        // Only what hangs together with the root is drawn: a node whose parent is missing is covered above.
        if (isWhole && hangsTogether(of, drawable, h, at.index))
            of.emit(frame, slot, i, at.index, askedOf(at, missingOctants(of, frame, h, slot, drawable, at), largest),
                    cut);
        return true;
    };
    walkTree(
        of, frame, i, step, onCulled, [](uint32_t) { return true; }, take);
}

}  // namespace

CutCost costOfTree(const CutFrame& frame, uint32_t i, int step, uint64_t most, Counted counted,
                   ActiveMembers* /*members*/) {
    const Hierarchy& h = frame.hierarchyOf(i);
    return OneOfRecords::isAll(h) ? costOfWalk(OneOfRecords{h}, frame, i, step, most, counted)
                                  : costOfWalk(AnyPayloads{h}, frame, i, step, most, counted);
}

void emitTree(const CutFrame& frame, uint32_t i, int step, ActiveMembers& /*members*/, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const size_t firstDraw = cut.draw.size(), firstMesh = cut.meshDraw.size();
    if (OneOfRecords::isAll(h))
        emitWalk(OneOfRecords{h}, frame, i, step, cut);
    else
        emitWalk(AnyPayloads{h}, frame, i, step, cut);
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
