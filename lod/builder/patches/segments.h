// Elements to segments that may become patches: connected components, split until the cone of normals is narrow enough,
// then merged again (Ochotta & Hiller 2006, 3.1).
#pragma once

#include <functional>
#include <vector>

#include "engine/base/executor.h"
#include "lod/builder/patches/elements.h"

namespace stipple::lod {

struct SegmentSettings {
    double coneCosine = 0.6427876096865394;  ///< of half the cone of a patch's normals: 50 degrees
    size_t mostElements = 1u << 20;          ///< of a segment that two are merged to
    std::function<bool()> isStopped;         ///< asked now and then; what is there then is of no use
};

/// Of a patch: its samples, and the records that there would be in its stead.
struct PatchCost {
    double samples, records;
};
/// Which patches are to go, those first that have the most samples a record, and two at least (a record has as many
/// bytes), until samples and records (`left` before) are no more than `most`.
std::vector<uint8_t> costliest(const std::vector<PatchCost>& costs, double left, double most);

/// Elements that links connect, in the order of their first ones.
std::vector<Segment> connectedComponents(const SurfaceElements& elements);

/// Halves of a segment at the median across its longest principal axis, by (place along it, index): never empty, if
/// there are two elements.
std::pair<Segment, Segment> halves(const SurfaceElements& elements, const Segment& segment);

/// Halved until every cone is narrow enough, in the order of their first elements.
std::vector<Segment> splitByCone(const SurfaceElements& elements, std::vector<Segment> segments,
                                 const SegmentSettings& settings, Executor& executor);

/// Neighbours merged while their cones allow it, those first that raise the sum of area |normal - mean|^2 least; keys
/// are integers, ties go by index.
std::vector<Segment> mergeByNormals(const SurfaceElements& elements, std::vector<Segment> segments,
                                    const SegmentSettings& settings);

}  // namespace stipple::lod
