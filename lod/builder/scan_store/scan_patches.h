// Patches of one node from points: those of a scan, or samples of the patches below.
#pragma once

#include <limits>

#include "lod/builder/patch_store/node_patches.h"
#include "lod/builder/patches/point_surface.h"

namespace stipple::lod {

enum class Lies : uint8_t {
    apart,   ///< too far from the node: only what is fitted looks at it
    beside,  ///< near enough to be a part of the node's patches
    within   ///< in the node's cell
};

struct ScanSettings {
    double coneDegrees = 50;  ///< half the cone of a patch's normals
    double leastStep = 1;     ///< between samples, scene units
    double samplesAPoint = 1;
    double mostSamples = std::numeric_limits<double>::infinity();  ///< and points left: the costliest patches go
    std::function<bool()> isStopped = {};                          ///< what is there then is of no use
};

struct ScanPatches {
    std::vector<Patch> patches;  ///< places relative to `corner`
    /// Of each patch, for each sample: does it stand for a point within the node, more than for one of another patch?
    std::vector<std::vector<uint8_t>> isOwn;
    std::vector<uint32_t> left;  ///< points within that no patch stands for, ascending
    double toPoints = 0;         ///< bound of the distance of any place of the patches from a point, scene units
    double fromPoints = 0;       ///< of any point within that is not left, from the patches
    uint64_t samples() const {
        uint64_t sum = 0;
        for (const Patch& p : patches) sum += p.samples();
        return sum;
    }
};

/// What of a surface patches are made of, one of each. `lies`: of each point of the surface.
std::vector<Segment> segmentsOfScan(const PointSurface& surface, const std::vector<Lies>& lies,
                                    const ScanSettings& settings, Executor& executor);

/// Of those segments; `corner`: of the node's cell. Patches overlap, and go on beyond the node over what is beside it.
ScanPatches patchesOfScan(const PointSurface& surface, const std::vector<Lies>& lies, std::vector<Segment> segments,
                          const glm::dvec3& corner, const ScanSettings& settings, Executor& executor);

/// Own samples about as far from each other as `step`, with their normals and colours; at places that are
/// rounded to 2^-10.
PointBlock samplesFor(const ScanPatches& made, const glm::dvec3& corner, double step);

}  // namespace stipple::lod
