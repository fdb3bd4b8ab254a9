// Elevation patches (lod/primitives/patch.h): blocks of 16 x 8 cells. A patch is a mesh of its own lattice, (i, j,
// height code), that its DrawMesh places; a block has no list of triangles, and its cells are numbers 16 j + i.
#ifndef STIPPLE_SHARED_PATCH_H
#define STIPPLE_SHARED_PATCH_H
#include "material.h"
#include "mesh.h"
SHARED_BEGIN

const uint kPatchCellsAcross = 16u;
const uint kPatchCellsUp = 8u;
const uint kPatchTriangles = 256u;  // of a block
const uint kPatchStride = 17u;      // samples of a row of a block
const uint kPatchSamples = 153u;    // of a block

const uint kPatchBlockWords = 7u + 2u * kPatchSamples + (kPatchSamples + 1u) / 2u;

// What is not there is 0. Lane 2 * cell + k of the block's draw ids is the cell's triangle k.
struct PatchBlock {
    uint number;                              // of its patch in the chunk
    uint place;                               // of its first sample in the patch: i | j << 16
    uint map;                                 // where its map lies (patch_map.h); 0: it has none
    uint cells[4];                            // a bit for each cell that is drawn
    uint normals[kPatchSamples];              // octahedral 16 + 16 of (U, V, N)
    uint colours[kPatchSamples];              // sRGB 8 + 8 + 8 | number of the material, which backends do not read
    uint heights[(kPatchSamples + 1u) / 2u];  // codes, two a word
};

// The three corners of a triangle of a cell, as samples of the block: 8 bits each, counter-clockwise seen from above.
// `corner`: sample of the cell's lower left corner; heights of lower left, lower right, upper left and upper right. The
// diagonal is the one whose heights differ less, of equal ones the rising one.
SHARED_FN uint patchTriangle(uint corner, int h0, int h1, int h2, int h3, uint k) {
    const bool isRising = abs(h0 - h3) <= abs(h1 - h2);
    const uint right = corner + 1u;
    const uint up = corner + kPatchStride;
    const uint across = up + 1u;
    const uint a = k == 0u || isRising ? corner : right;
    const uint b = k == 0u ? right : across;
    const uint c = k == 1u || !isRising ? up : across;
    return a | b << 8 | c << 16;
}

// What of light a sample's material (material.h) gives back: metallic and roughness; rough where it has none.
SHARED_FN vec2 patchFinish(uint material) {
    const bool isPlain = material >= kPlainPoint;
    const float metallic = float(int(material & 255u)) * (1.0f / 255.0f);
    const float roughness = float(int(material >> 8 & 255u)) * (1.0f / 255.0f);
    return vec2(isPlain ? 0.0f : metallic, isPlain ? 1.0f : roughness);
}

SHARED_END
#endif
