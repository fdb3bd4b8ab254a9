// What a node's patches and discs are in the file.
#pragma once

#include <vector>

#include "lod/builder/patch_store/node_patches.h"

namespace stipple::lod {

struct DiscPayload {
    std::vector<uint8_t> bytes;
    double moved = 0;  ///< farthest that a place was moved to lie in the cell, lattice units
};

/// Blocks of at most 16 x 8 cells that hold one that is drawn, of all patches.
uint32_t blocksIn(const std::vector<Patch>& patches);

/// Discs whose places do not lie in the cell of `node`, or of an inner one in none of its children's, are moved there
/// and grow by as much. Records have the own error code `code`. Changes `discs` to what the file says of them.
DiscPayload encodeDiscs(std::vector<LeftDisc>& discs, const Frame& frame, const Node& node, uint32_t code);

/// Enlarges the box so that it holds all samples; `corner`: of the node's cell.
void addSamples(const std::vector<Patch>& patches, const glm::dvec3& corner, glm::dvec3& lo, glm::dvec3& hi);
/// The farthest of all samples from `centre`.
double farthestSample(const std::vector<Patch>& patches, const glm::dvec3& corner, const glm::dvec3& centre);

}  // namespace stipple::lod
