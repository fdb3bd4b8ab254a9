// Samples of elevation patches as points, to be drawn in any mode that points are drawn in.
#pragma once

#include <span>

#include "lod/store/chunk.h"
#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// In the place of FrameConstants::patchAs: there are no patches, but points.
constexpr uint32_t kPatchesAsSamples = 3;

/// Records of a chunk of so many blocks.
inline constexpr uint64_t recordsOfSamples(uint64_t blocks) { return blocks * shared::kPatchSamples; }

/// Own error code of records that stand for no sample: larger than any view of samples allows.
constexpr uint32_t kNoSample = 255;

/// In the place of a chunk's blocks: a point for each sample, then records without one, as many as the blocks have
/// places. A sample stands for the nearest quarter of each drawn cell around it, and its disc is a sphere's about
/// those: where the surface goes on on all sides it lies at the sample and is as large as Ochotta, Hiller & Saupe 2006,
/// Eq 1, has it (half the lifted diagonal of a cell, at most that of a surface 60 degrees from its plane); at a border
/// it lies in the middle of what is there, so that it stands out by less than a third of a step and not by 0.7. It has
/// the sample's normal if its rim then lies no farther than half a step off the cells, else the cells' own. They stand
/// on the steps of the node's cell that points stand on, so they are off by half of one. Patches reach over the borders
/// of the cell; their samples there are left to the neighbour.
void samplesAsPoints(const Hierarchy& h, uint32_t chunk, Chunk& of);

/// Is any payload one of patches?
bool hasPatches(const Hierarchy& h);

/// Records of points, without those at the end that stand for no sample.
std::span<const shared::PointRecord> withoutEmpty(std::span<const shared::PointRecord> records);

/// A payload of points at the same node: where samples stand as it says.
Payload payloadOfSamples(const Hierarchy& h, uint32_t chunk);

}  // namespace stipple::lod
