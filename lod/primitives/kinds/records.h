// What kinds have in common whose payloads are records side by side.
#pragma once

#include "lod/primitives/codecs.h"
#include "lod/primitives/kinds.h"

namespace stipple::lod {

/// Bytes of a payload whose records lie side by side.
template <typename Record>
uint64_t bytesOfRecords(const Hierarchy& h, uint32_t chunk) {
    return uint64_t{h.payload(chunk).records} * sizeof(Record);
}
inline bool isAnything(const Hierarchy&, uint32_t) { return true; }
inline uint64_t recordsOfLeaf(const Hierarchy& h, uint32_t chunk) {
    return h.nodes[h.nodeOf(chunk)].isLeaf() ? h.ownRecordsOf(h.payload(chunk)) : 0u;
}

}  // namespace stipple::lod
