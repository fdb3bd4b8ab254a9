// Maps of a block of a patch: colours, and normals, materials and light of its own where it has them, at 2, 4 or 8
// texels along each edge of a cell, with mips (Ochotta, Hiller & Saupe 2006, 3.2 and 3.5). Light may also be there
// alone, a texel a sample.
//
// Texels lie on the corners of a lattice, as samples do: level l has (16 k >> l) + 1 across and (8 k >> l) + 1 up, the
// first one on the block's first sample. So each texel at the border of a block is its neighbour's, too, and nothing
// is seen where they meet. Levels stand one after another, row by row; the last one has a texel every eight cells.
// Colours come first (unless there is a texel a sample), then as many words of normals, then of light.
#ifndef STIPPLE_SHARED_PATCH_MAP_H
#define STIPPLE_SHARED_PATCH_MAP_H
#include "patch.h"
#include "texture.h"
SHARED_BEGIN

// PatchBlock::map: log2 of texels along an edge of a cell (0: colours are those of the samples) | kMap... | first word,
// among the words of its chunk's maps. 0: the block has no map.
const uint kMapDensity = 3u;
const uint kMapNormals = 4u;    // octahedral 16 + 16 of (U, V, N); else those of the samples are mixed
const uint kMapMaterials = 8u;  // above colours: roughness 4 | metallic 4, as patchMapFinish has it; else the samples'
const uint kMapLight = 16u;     // words of mapEmission
const uint kMapFirstShift = 5u;
const uint kMapLevelsMore = 4u;  // levels of a map of density 1 (samples alone), and one more for each doubling

SHARED_FN uint mapLevels(uint density) { return density + kMapLevelsMore; }
SHARED_FN uint mapCellsAcross(uint density, uint level) { return kPatchCellsAcross << density >> level; }
SHARED_FN uint mapCellsUp(uint density, uint level) { return kPatchCellsUp << density >> level; }
// Texels of all levels before this one, of which no level is coarser than the last.
SHARED_FN uint mapLevelFirst(uint density, uint level) {
    const uint area = kPatchCellsAcross * kPatchCellsUp << 2u * density;
    const uint sides = (kPatchCellsAcross + kPatchCellsUp) << density;
    return 4u * (area - (area >> 2u * level)) / 3u + 2u * (sides - (sides >> level)) + level;
}
SHARED_FN uint mapTexels(uint density) {
    const uint last = mapLevels(density) - 1u;
    return mapLevelFirst(density, last) + (mapCellsAcross(density, last) + 1u) * (mapCellsUp(density, last) + 1u);
}
// Words of a map whose PatchBlock::map has these lower bits.
SHARED_FN uint mapWords(uint map) {
    const uint colours = (map & kMapDensity) == 0u ? 0u : 1u;
    const uint normals = (map & kMapNormals) != 0u ? colours : 0u;
    return (colours + normals + ((map & kMapLight) != 0u ? 1u : 0u)) * mapTexels(map & kMapDensity);
}
// The first word of light, from the map's own.
SHARED_FN uint mapLightFirst(uint map) { return mapWords(map & (kMapDensity | kMapNormals)); }

// Light that a texel sends by itself, linear. A word: sRGB 8 + 8 + 8 | log2 of what that is multiplied with 4 | 0 | is
// it shown as it is, and not lit.
const uint kMapUnlit = 0x80000000u;
SHARED_FN vec3 mapEmission(uint word) {
    const float times = (word & kMapUnlit) != 0u ? 0.0f : float(int(1u << (word >> 24 & 15u)));
    return vec3(times * linearFromByte(float(int(word & 255u)) * (1.0f / 255.0f)),
                times * linearFromByte(float(int(word >> 8 & 255u)) * (1.0f / 255.0f)),
                times * linearFromByte(float(int(word >> 16 & 255u)) * (1.0f / 255.0f)));
}

// The four texels of a level around a place, samples from the block's first one: that below and left of it, how far it
// is to the row above, and what is left over.
struct MapTap {
    uint first;
    uint stride;
    float fx;
    float fy;
};
SHARED_FN MapTap mapTap(uint density, uint level, float i, float j) {
    const uint across = mapCellsAcross(density, level);
    const uint up = mapCellsUp(density, level);
    const float scale = float(int(1u << density)) / float(int(1u << level));
    const float x = min(max(i * scale, 0.0f), float(int(across)));
    const float y = min(max(j * scale, 0.0f), float(int(up)));
    const float x0 = min(floor(x), float(int(across)) - 1.0f);
    const float y0 = min(floor(y), float(int(up)) - 1.0f);
    MapTap t;
    t.stride = across + 1u;
    t.first = mapLevelFirst(density, level) + uint(int(y0)) * t.stride + uint(int(x0));
    t.fx = x - x0;
    t.fy = y - y0;
    return t;
}
// Of the tap's texel c: 0 to 3, right and up as bits.
SHARED_FN float mapWeight(MapTap t, uint c) {
    return ((c & 1u) != 0u ? t.fx : 1.0f - t.fx) * (c > 1u ? t.fy : 1.0f - t.fy);
}
SHARED_FN uint mapTexelOf(MapTap t, uint c) { return t.first + (c & 1u) + (c > 1u ? t.stride : 0u); }

// The finest level of a footprint, cells, and how much of the next one is mixed in.
struct MapLod {
    uint level;
    uint next;
    float share;
};
SHARED_FN MapLod mapLod(uint density, float cells) {
    const float last = float(int(mapLevels(density))) - 1.0f;
    const float lod = min(textureLod(cells * float(int(1u << density))), last);
    MapLod m;
    m.level = uint(int(lod));
    m.next = m.level + 1u < mapLevels(density) ? m.level + 1u : m.level;
    m.share = lod - floor(lod);
    return m;
}

// Metallic and roughness of a texel's material.
SHARED_FN vec2 patchMapFinish(uint texel) {
    return vec2(float(int(texel >> 28)) * (1.0f / 15.0f), 1.0f - float(int(texel >> 24 & 15u)) * (1.0f / 15.0f));
}

// Samples from the block's first one that a pixel covers on a disc: the longer of its two edges.
SHARED_FN float discFootprint(PixelRay ray, float inverseFocal, vec3 centre, vec3 normal, DrawMesh m) {
    const float xx = dot(m.axisX, m.axisX);
    const float yy = dot(m.axisY, m.axisY);
    const float nn = max(dot(normal, normal), 1.0e-37f);
    const float nx = dot(normal, m.axisX) / nn;
    const float ny = dot(normal, m.axisY) / nn;
    const vec3 e1 = vec3(m.axisX.x - nx * normal.x, m.axisX.y - nx * normal.y, m.axisX.z - nx * normal.z);
    const vec3 e2 = vec3(m.axisY.x - ny * normal.x, m.axisY.y - ny * normal.y, m.axisY.z - ny * normal.z);
    return uvFootprint(ray, inverseFocal, centre, e1, e2, vec2(dot(e1, m.axisX) / xx, dot(e1, m.axisY) / yy),
                       vec2(dot(e2, m.axisX) / xx, dot(e2, m.axisY) / yy));
}

SHARED_END
#endif
