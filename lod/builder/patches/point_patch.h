// One segment of points to one patch.
#pragma once

#include <algorithm>

#include "lod/builder/patches/patch_build.h"
#include "lod/builder/patches/point_surface.h"

namespace stipple::lod {

struct PointPatch {
    bool isFolded = false;       ///< no height field: to be split
    Patch patch;                 ///< without samples: it stands for no point
    std::vector<uint32_t> left;  ///< points of the segment that it does not stand for
    /// Of each sample of `patch` the nearest of the points that it was made of; kNoPoint where there is no sample.
    std::vector<uint32_t> nearest;
    static constexpr uint32_t kNoPoint = ~0u;
    std::vector<uint32_t> segment;  ///< points that it was made for, ascending: without those that are too steep
    bool isOfSegment(uint32_t point) const { return std::binary_search(segment.begin(), segment.end(), point); }
    // Sums for the root mean squares, each of as many.
    double toSource = 0, fromSource = 0;
    uint64_t represented = 0;
};

/// Samples by moving least squares around the segment's points. A point is stood for where a cell lies over it, no
/// farther than a step. A height field is what has in each cell (of which at most a fiftieth of the points may be
/// excepted) no more spread than sqrt(2) step tan(theta) + 3 noise (theta: half the cone; noise: of the median point).
PointPatch patchOfPoints(const PointSurface& surface, const Segment& segment, double step, PatchClosing closing);

/// The step at which a segment gets `samples` a point for its area along the axis of its cone.
double stepOf(const PointSurface& surface, const Segment& segment, double samples);

}  // namespace stipple::lod
