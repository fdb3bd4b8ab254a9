#include "lod/builder/points/inside.h"

#include "engine/base/lanes.h"
#include "engine/base/wide.h"

namespace stipple::lod {

STIPPLE_WIDE size_t findInside(const NarrowPlaces& places, size_t begin, size_t end, const NarrowBox& box,
                               uint32_t* inside) {
    const std::array<const uint32_t*, 3> columns{places.x, places.y, places.z};
    std::array<uint32_t, 3> extent{};
    for (size_t a = 0; a < 3; ++a) extent[a] = box.hi[a] - box.lo[a];
    size_t count = 0, i = begin;
    for (; i + kLanes <= end; i += kLanes) {
        Lanes is = Lanes{} - 1;
        for (size_t a = 0; a < 3; ++a) {
            const Words offset = reinterpret_cast<const Anywhere<Words>*>(columns[a] + i)->v - box.lo[a];
            is &= reinterpret_cast<Lanes>(offset <= extent[a]);
        }
        if (!isAny(is)) continue;
        for (size_t k = 0; k < kLanes; ++k) {  // without a branch
            inside[count] = static_cast<uint32_t>(i + k);
            count += static_cast<uint32_t>(is[k]) & 1u;
        }
    }
    for (; i < end; ++i) {
        bool is = true;
        for (size_t a = 0; a < 3; ++a) is = is && columns[a][i] - box.lo[a] <= extent[a];
        if (is) inside[count++] = static_cast<uint32_t>(i);
    }
    return count;
}

}  // namespace stipple::lod
