// Blocks of elevation patches as the passes that draw them see them.
#include "coverage.glsl"
#include "shared/patch.h"

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer PatchBlocks { PatchBlock blocks[]; };

PatchBlocks patchBlocksOf(DrawNode node) { return PatchBlocks(uvec2(node.addressLow, node.addressHigh)); }

int patchHeight(PatchBlocks of, uint block, uint s) {
    return int(of.blocks[block].heights[s / 2u] >> 16u * (s & 1u) & 0xffffu);
}
bool patchHasCell(PatchBlocks of, uint block, uint cell) {
    return (of.blocks[block].cells[cell / 32u] >> cell % 32u & 1u) != 0u;
}
// Metallic and roughness of sample s: behind the blocks, unless all have the same.
vec2 patchFinishOf(DrawNode node, uint block, uint s) {
    if (node.materials == 0u || (node.material & kOnlyMaterial) != 0u) return patchFinish(node.material & ~kOnlyMaterial);
    const uint number = block * kPatchSamples + s;
    const uint pair = RecordWords(uvec2(node.addressLow, node.addressHigh)).words[kPatchBlockWords * node.materials + number / 2u];
    return patchFinish((number & 1u) != 0u ? pair >> 16 : pair & 0xffffu);
}
// Of sample s, in camera space.
vec3 patchPlace(PatchBlocks of, uint block, DrawMesh m, uint s) {
    const uint place = of.blocks[block].place;
    return meshPosition(int((place & 0xffffu) + s % kPatchStride), int((place >> 16) + s / kPatchStride), patchHeight(of, block, s), m);
}
// Corners of the triangle with that lane.
uint patchCorners(PatchBlocks of, uint block, uint lane) {
    const uint cell = lane / 2u;
    const uint at = kPatchStride * (cell / kPatchCellsAcross) + cell % kPatchCellsAcross;
    return patchTriangle(at, patchHeight(of, block, at), patchHeight(of, block, at + 1u), patchHeight(of, block, at + kPatchStride),
                         patchHeight(of, block, at + kPatchStride + 1u), lane & 1u);
}
