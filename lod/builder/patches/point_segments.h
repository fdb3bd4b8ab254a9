// Segments of points to patches, each at the step that it is given.
#pragma once

#include <functional>

#include "engine/base/executor.h"
#include "lod/builder/patches/point_patch.h"

namespace stipple::lod {

constexpr size_t kFewestPoints = 24;  ///< of a segment that may become a patch

struct PointSampling {
    PatchClosing closing = PatchClosing::overlap;
    std::function<double(const Segment&)> step;  ///< scene units
    std::function<bool()> isStopped;             ///< what is there then is of no use
    std::function<void(uint64_t done)> tell;     ///< so many points have their patches; may be empty
};

struct SampledPoints {
    struct Made {
        uint32_t first = 0;  ///< point of its segment
        PointPatch patch;
    };
    std::vector<Made> patches;   ///< in the order of their first points
    std::vector<uint32_t> left;  ///< points that no patch stands for, ascending
    /// Leaves the costliest patches until there are no more than so many samples and left points.
    void leaveCostly(double most);
};

/// A segment that folds is halved and tried again; one of fewer than kFewestPoints is left.
SampledPoints samplePoints(const PointSurface& surface, std::vector<Segment> segments, const PointSampling& settings,
                           Executor& executor);

}  // namespace stipple::lod
