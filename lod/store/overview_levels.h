// The levels of an overview (Hierarchy::overviewOf) among the records of a chunk as it is drawn.
#pragma once

#include <span>

#include "shaders/shared/record.h"

namespace stipple::lod {

/// Calls use(begin, end) for each, the coarsest first: records that follow each other and have one error.
template <typename Use>
void forEachOverviewLevel(std::span<const shared::PointRecord> overview, const Use& use) {
    for (size_t begin = 0, end = 0; begin < overview.size(); begin = end) {
        const uint32_t code = shared::recordErrorCode(overview[begin]);
        while (end < overview.size() && shared::recordErrorCode(overview[end]) == code) ++end;
        use(begin, end);
    }
}

}  // namespace stipple::lod
