// What the cut of an octree has of a payload of points or curves: a beginning of its records, without those that its
// node's children replace.
#include "lod/cut/frame.h"

namespace stipple::lod {

uint64_t costOfRecords(const Hierarchy& h, uint32_t chunk, const Asked& asked) {
    return prefixOf(h, h.payload(chunk), asked).drawn();
}

void emitRecords(const CutFrame& frame, uint32_t i, uint32_t chunk, const Asked& asked, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    appendRecords(slotOf(frame, i), h, i, h.nodeOf(chunk), chunk, h.payload(chunk), asked, cut);
}

}  // namespace stipple::lod
