// Segments of a mesh to patches, each at the step that it is given.
#pragma once

#include <functional>
#include <limits>

#include "engine/base/executor.h"
#include "lod/builder/patches/mesh_patch.h"

namespace stipple::lod {

struct SampleSettings {
    PatchClosing closing = PatchClosing::overlap;
    std::function<double(const Segment&)> step;  ///< scene units, to begin with
    /// Bound of the distance, either way, that is worth more patches and samples; scene units. No patch is left for it.
    double wanted = std::numeric_limits<double>::infinity();
    std::function<bool()> isStopped;          ///< what is there then is of no use
    std::function<void(uint64_t done)> tell;  ///< so many elements have their patches; may be empty
};

struct SegmentPatch {
    uint32_t first = 0;  ///< element of its segment
    MeshPatch patch;
    Segment segment;
    double step = 0;  ///< that it was sampled with
};

struct SampledSegments {
    std::vector<SegmentPatch> patches;  ///< in the order of their first elements
    std::vector<uint32_t> left;         ///< elements that no patch stands for, ascending
    uint64_t samples() const;
    /// Leaves the costliest patches until there are no more than so many samples and records of what is left.
    /// `recordsOf`: of an element.
    void leaveCostly(double most, const std::function<double(uint32_t)>& recordsOf);
    /// Looks of what is kept, samples' and maps': nothing has any before.
    void dress(const MeshSurface& surface, const SampleSettings& settings, Executor& executor);
};

/// A segment that folds is halved and tried again, one that is thin is sampled up to eight times as densely, and what
/// stays thin is left. Elements in no segment are only gone on over.
SampledSegments sampleSegments(const MeshSurface& surface, std::vector<Segment> segments,
                               const SampleSettings& settings, Executor& executor);

}  // namespace stipple::lod
