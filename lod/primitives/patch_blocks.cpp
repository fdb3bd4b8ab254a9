#include "lod/primitives/patch_blocks.h"

#include <algorithm>

#include "lod/primitives/patch_map.h"

namespace stipple::lod {
namespace {

using shared::kPatchCellsAcross, shared::kPatchCellsUp, shared::kPatchStride;

/// Calls use(i, j) with the first cell of each block that has one to draw.
template <typename Use>
void forEachBlock(const Patch& p, const Use& use) {
    for (uint32_t j = 0; j + 1 < p.height; j += kPatchCellsUp)
        for (uint32_t i = 0; i + 1 < p.width; i += kPatchCellsAcross) {
            bool any = false;
            for (uint32_t v = j; v < std::min(j + kPatchCellsUp, p.height - 1); ++v)
                for (uint32_t u = i; u < std::min(i + kPatchCellsAcross, p.width - 1); ++u)
                    any = any || p.hasCell(u, v);
            if (any) use(i, j);
        }
}

shared::PatchBlock blockAt(const Patch& p, uint32_t i, uint32_t j, uint32_t number) {
    shared::PatchBlock b{};
    const uint32_t across = std::min(kPatchStride, p.width - i), up = std::min(kPatchCellsUp + 1, p.height - j);
    b.number = number;
    b.place = i | j << 16;
    for (uint32_t v = 0; v < up; ++v)
        for (uint32_t u = 0; u < across; ++u) {
            const size_t from = p.at(i + u, j + v);
            const uint32_t to = kPatchStride * v + u;
            b.normals[to] = p.normals[from];
            b.colours[to] =
                (p.colours[from] & 0xffffffu) | uint32_t{p.materials.empty() ? uint8_t{0} : p.materials[from]} << 24;
            b.heights[to / 2] |= uint32_t{p.heights[from]} << (16 * (to % 2));
            const uint32_t cell = kPatchCellsAcross * v + u;
            if (u + 1 < across && v + 1 < up && p.hasCell(i + u, j + v)) b.cells[cell / 32] |= 1u << (cell % 32);
        }
    return b;
}

void append(const Patch& p, uint32_t number, PatchBlocks& out) {
    const PatchMips mips(p);
    forEachBlock(p, [&](uint32_t i, uint32_t j) {
        out.blocks.push_back(blockAt(p, i, j, number));
        out.blocks.back().map = mips.appendTo(out.maps, i, j);
        out.planes.push_back({p.origin, p.turn, p.step, p.quantumExponent});
    });
}

}  // namespace

PatchBlocks blocksOf(const Patch& patch, uint32_t number) {
    PatchBlocks out;
    append(patch, number, out);
    return out;
}

PatchBlocks blocksOf(std::span<const Patch> patches) {
    PatchBlocks out;
    for (size_t k = 0; k < patches.size(); ++k) append(patches[k], static_cast<uint32_t>(k), out);
    return out;
}

void planesOfPatches(std::span<const shared::PatchBlock> blocks, std::span<const PatchPlane> planes,
                     std::vector<PatchPlane>& out) {
    out.clear();
    for (size_t b = 0; b < blocks.size(); ++b)
        if (blocks[b].number >= out.size()) out.resize(blocks[b].number + 1, planes[b]);
}

uint32_t countBlocks(const Patch& patch) {
    uint32_t count = 0;
    forEachBlock(patch, [&](uint32_t, uint32_t) { ++count; });
    return count;
}

}  // namespace stipple::lod
