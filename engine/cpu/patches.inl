// Elevation patches of the cpu backend: blocks of cells as triangles. Included by kernels.inl.

/// Codes of a block's samples.
[[gnu::always_inline]] inline void patchHeights(const PatchBlock& block, int32_t* __restrict heights) {
    for (size_t k = 0; k < (kPatchSamples + 1) / 2; ++k) {
        heights[2 * k] = static_cast<int32_t>(block.heights[k] & 0xffffu);
        heights[2 * k + 1] = static_cast<int32_t>(block.heights[k] >> 16);
    }
}
[[gnu::always_inline]] inline int32_t patchHeight(const PatchBlock& block, uint32_t sample) {
    return static_cast<int32_t>(block.heights[sample / 2] >> (16 * (sample % 2)) & 0xffffu);
}

/// Places of all samples of a block; those that are not there lie on the plane.
[[gnu::always_inline]] inline void placeSamples(const PatchBlock& block, const DrawMesh& m,
                                                const int32_t* __restrict heights, PlacedCorners& __restrict p) {
    const int i0 = static_cast<int>(block.place & 0xffffu), j0 = static_cast<int>(block.place >> 16);
    for (int j = 0; j <= static_cast<int>(kPatchCellsUp); ++j) {
        const size_t first = static_cast<size_t>(j) * kPatchStride;
#pragma GCC ivdep
        for (size_t i = 0; i < kPatchStride; ++i) {
            const vec3 c = meshPosition(i0 + static_cast<int>(i), j0 + j, heights[first + i], m);
            p.x[first + i] = c.x;
            p.y[first + i] = c.y;
            p.z[first + i] = c.z;
        }
    }
}

void rasterPatch(const FrameConstants& frame, const PatchSource& source, uint32_t firstPlace, const LargeSink& large,
                 const Visibility& visibility) {
    const FrameConstants f = frame;
    const PatchBlock& block = *source.block;
    alignas(64) int32_t heights[kPatchSamples + 1];
    PlacedCorners p;
    patchHeights(block, heights);
    placeSamples(block, *source.mesh, heights, p);
    projectCorners(f, kPatchSamples, p);
    const uint64_t firstId = drawId(f.firstBlock.of[kKindPatches], firstPlace);
    for (uint32_t word = 0; word < 4; ++word)
        for (uint32_t left = block.cells[word]; left != 0; left &= left - 1) {
            const uint32_t cell = 32 * word + static_cast<uint32_t>(__builtin_ctz(left));
            const uint32_t at = kPatchStride * (cell / kPatchCellsAcross) + cell % kPatchCellsAcross;
            for (uint32_t k = 0; k < 2; ++k) {
                const uint32_t t = patchTriangle(at, heights[at], heights[at + 1], heights[at + kPatchStride],
                                                 heights[at + kPatchStride + 1], k);
                offerTriangle(f, p, t & 255u, t >> 8 & 255u, t >> 16, {firstId + 2 * cell + k, true, nullptr}, large,
                              visibility);
            }
        }
}
