// Blocks of elevation patches as the passes that draw them see them.
#include "coverage.glsl"
#include "shared/patch.h"
#include "shared/patch_map.h"

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
    if (node.materials == 0u || (node.material & kOnlyMaterial) != 0u)
        return patchFinish(node.material & ~kOnlyMaterial);
    const uint number = block * kPatchSamples + s;
    const uint pair =
        RecordWords(uvec2(node.addressLow, node.addressHigh)).words[kPatchBlockWords * node.materials + number / 2u];
    return patchFinish((number & 1u) != 0u ? pair >> 16 : pair & 0xffffu);
}
// The map of a block stands among the words behind all blocks of its chunk, and behind the materials of their samples.
struct MapLook {
    vec3 colour;
    vec3 normal;  // of (U, V, N), any length
    vec2 finish;
};
uint mapFirst(DrawNode node, uint map) {
    const uint ofMaterials = node.materials != 0u ? (node.count * kPatchSamples + 1u) / 2u : 0u;
    return kPatchBlockWords * node.count + ofMaterials + (map >> kMapFirstShift);
}
// i, j: samples from the block's first one; `cells`: that a pixel covers there.
MapLook mapLook(DrawNode node, uint map, float i, float j, float cells) {
    RecordWords words = RecordWords(uvec2(node.addressLow, node.addressHigh));
    const uint first = mapFirst(node, map);
    const uint density = map & kMapDensity;
    const uint normals = first + mapTexels(density);
    const MapLod lod = mapLod(density, cells);
    MapLook look = MapLook(vec3(0.0), vec3(0.0), vec2(0.0));
    for (uint l = 0u; l < 2u; ++l) {
        const float share = l == 0u ? 1.0 - lod.share : lod.share;
        if (!(share > 0.0)) continue;
        const MapTap tap = mapTap(density, l == 0u ? lod.level : lod.next, i, j);
        for (uint c = 0u; c < 4u; ++c) {
            const float w = share * mapWeight(tap, c);
            const uint texel = words.words[first + mapTexelOf(tap, c)];
            look.colour += w * decodeTexel(texel, true).xyz;
            look.finish += w * patchMapFinish(texel);
            if ((map & kMapNormals) != 0u) look.normal += w * octDecode(words.words[normals + mapTexelOf(tap, c)]);
        }
    }
    return look;
}
// What a place sends by itself, and how much of it is not lit.
struct MapLight {
    vec3 emission;
    float unlit;
};
MapLight mapLight(DrawNode node, uint map, float i, float j, float cells) {
    RecordWords words = RecordWords(uvec2(node.addressLow, node.addressHigh));
    const uint first = mapFirst(node, map) + mapLightFirst(map);
    const uint density = map & kMapDensity;
    const MapLod lod = mapLod(density, cells);
    MapLight light = MapLight(vec3(0.0), 0.0);
    for (uint l = 0u; l < 2u; ++l) {
        const float share = l == 0u ? 1.0 - lod.share : lod.share;
        if (!(share > 0.0)) continue;
        const MapTap tap = mapTap(density, l == 0u ? lod.level : lod.next, i, j);
        for (uint c = 0u; c < 4u; ++c) {
            const float w = share * mapWeight(tap, c);
            const uint word = words.words[first + mapTexelOf(tap, c)];
            light.emission += w * mapEmission(word);
            if ((word & kMapUnlit) != 0u) light.unlit += w;
        }
    }
    return light;
}
// Of sample s, in camera space.
vec3 patchPlace(PatchBlocks of, uint block, DrawMesh m, uint s) {
    const uint place = of.blocks[block].place;
    return meshPosition(int((place & 0xffffu) + s % kPatchStride), int((place >> 16) + s / kPatchStride),
                        patchHeight(of, block, s), m);
}
// Corners of the triangle with that lane.
uint patchCorners(PatchBlocks of, uint block, uint lane) {
    const uint cell = lane / 2u;
    const uint at = kPatchStride * (cell / kPatchCellsAcross) + cell % kPatchCellsAcross;
    return patchTriangle(at, patchHeight(of, block, at), patchHeight(of, block, at + 1u),
                         patchHeight(of, block, at + kPatchStride), patchHeight(of, block, at + kPatchStride + 1u),
                         lane & 1u);
}
