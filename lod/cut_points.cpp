// What the cut of an octree has of a payload of points or curves: a beginning of its records, without those that its
// node's children replace.
#include <algorithm>

#include "lod/cut_frame.h"

namespace stipple::lod {
namespace {

/// The first records that are looked at, and those among them that are left to the children.
struct Prefix {
    uint32_t count, tooCoarse;
};
Prefix prefixOf(const Hierarchy& h, const Payload& p, const Asked& asked) {
    return {h.countGreater(p.parentCounts, p.records, asked.parentCode),
            asked.octantMask != 0 ? 0 : h.countGreater(p.ownCounts, p.records, asked.code)};
}

}  // namespace

uint64_t costOfRecords(const Hierarchy& h, uint32_t chunk, const Asked& asked) {
    const Prefix prefix = prefixOf(h, h.payload(chunk), asked);
    return prefix.count - prefix.tooCoarse;
}

void emitRecords(const CutFrame& frame, uint32_t i, uint32_t chunk, const Asked& asked, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const Payload& p = h.payload(chunk);
    const auto [count, tooCoarse] = prefixOf(h, p, asked);
    if (count == 0) return;
    cut.counters.recordsDrawn += count - tooCoarse;
    cut.counters.recordsTested += count;
    const double delivered = deliveredPixels(slotOf(frame, i), p.errorCode, asked);
    if (asked.octantMask) cut.tauEffective = std::max(cut.tauEffective, delivered);
    if (count > tooCoarse)
        cut.draw.push_back(
            {i, h.nodeOf(chunk), chunk, count, asked.code, asked.octantMask, static_cast<float>(delivered)});
}

}  // namespace stipple::lod
