// Where the patches of a frame lie: each is a mesh of its own lattice, (i, j, height code), placed in camera space.
#pragma once

#include <functional>
#include <vector>

#include "engine/render/draw_list.h"
#include "lod/primitives/patch_blocks.h"

namespace stipple::render {

/// Fills `meshes` with the patches of one drawn node after another, and `first` with the first of each node. Composed
/// in fp64 relative to the eye, rounded once; counted from the lattice point nearest to the eye, so that places near it
/// keep their digits, and the same for all blocks of a patch, so that they meet. `planesOf(chunk)`: of each patch.
void placePatches(const DrawList& draws,
                  const std::function<const std::vector<lod::PatchPlane>&(streaming::ChunkKey)>& planesOf,
                  std::vector<shared::DrawMesh>& meshes, std::vector<uint32_t>& first);

}  // namespace stipple::render
