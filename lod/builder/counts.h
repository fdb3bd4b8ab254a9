// Counts per error code, as the node table has them.
#pragma once

#include <vector>

#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// `histogram`: records of each of the 256 codes, `records` in all and at least one. Appends to `greaterThan`.
inline CodeCounts makeCodeCounts(const std::vector<uint32_t>& histogram, uint32_t records,
                                 std::vector<uint32_t>& greaterThan) {
    CodeCounts c;
    c.first = static_cast<uint32_t>(greaterThan.size());
    uint32_t lo = 0, hi = 255;
    while (histogram[lo] == 0) ++lo;
    while (histogram[hi] == 0) --hi;
    c.lo = static_cast<uint8_t>(lo);
    c.hi = static_cast<uint8_t>(hi);
    uint32_t left = records;
    for (uint32_t code = lo; code < hi; ++code) greaterThan.push_back(left -= histogram[code]);
    return c;
}

}  // namespace stipple::lod
