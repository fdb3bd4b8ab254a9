// Patches as backends draw them: blocks of cells, in the order of patches and, in each, row by row of blocks. Blocks
// without a drawn cell there are none.
#pragma once

#include <span>
#include <vector>

#include "lod/primitives/patch.h"
#include "shaders/shared/patch.h"

namespace stipple::lod {

/// Where the patch of a block lies: lengths in lattice steps, counted from the lower corner of the node's cell.
struct PatchPlane {
    glm::dvec3 origin{0};
    glm::quat turn{1, 0, 0, 0};
    float step = 1;
    int32_t quantumExponent = 0;
};

struct PatchBlocks {
    std::vector<shared::PatchBlock> blocks;
    std::vector<PatchPlane> planes;  ///< of each block
    std::vector<uint32_t> maps;      ///< words that PatchBlock::map points into
};

/// Of each patch that has a number among the blocks, from those of the blocks; into `out`, whose memory is used again.
void planesOfPatches(std::span<const shared::PatchBlock> blocks, std::span<const PatchPlane> planes,
                     std::vector<PatchPlane>& out);

/// Blocks of one patch; `number`: its place among those of its chunk. Above colours stand numbers of materials.
PatchBlocks blocksOf(const Patch& patch, uint32_t number = 0);
/// Of all patches of a chunk, one after another.
PatchBlocks blocksOf(std::span<const Patch> patches);
/// How many those are.
uint32_t countBlocks(const Patch& patch);

}  // namespace stipple::lod
