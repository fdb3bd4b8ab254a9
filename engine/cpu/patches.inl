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

/// Pixels whose rays may meet something; none where last < first.
struct PixelBox {
    int fromX, toX, fromY, toY;
    bool isEmpty() const { return toX < fromX || toY < fromY; }
};

[[gnu::always_inline]] inline uint32_t cellCorner(uint32_t cell) {
    return kPatchStride * (cell / kPatchCellsAcross) + cell % kPatchCellsAcross;
}

/// Do all four lie before the near plane, or beyond one side of the picture?
bool isBeside(const FrameConstants& f, const PlacedCorners& p, const uint32_t* c) {
    const Lens lens = lensHere(f.focal);
    const float width = float(int(f.width)), height = float(int(f.height));
    uint32_t out = 31;
    for (size_t k = 0; k < 4; ++k) {
        const float x = p.x[c[k]] * f.focal, y = p.y[c[k]] * f.focal, z = p.z[c[k]], w = lensDepth(lens, z);
        out &= (z < f.nearPlane ? 1u : 0u) | (x < -(f.centre.x + 1.0f) * w ? 2u : 0u) |
               (x > (width + 1.0f - f.centre.x) * w ? 4u : 0u) | (y < -(f.centre.y + 1.0f) * w ? 8u : 0u) |
               (y > (height + 1.0f - f.centre.y) * w ? 16u : 0u);
    }
    return out != 0;
}

/// Pixels around the four corners of a cell; all of the picture where some of them lie before the near plane.
[[gnu::always_inline]] inline PixelBox boxOfCell(const FrameConstants& f, const PlacedCorners& p, uint32_t at) {
    const uint32_t c[4] = {at, at + 1, at + kPatchStride, at + kPatchStride + 1};
    const int right = static_cast<int>(f.width) - 1, bottom = static_cast<int>(f.height) - 1;
    int minX = p.px[c[0]], maxX = minX, minY = p.py[c[0]], maxY = minY, clip = p.clip[c[0]];
    for (size_t k = 1; k < 4; ++k) {
        const int x = p.px[c[k]], y = p.py[c[k]];
        minX = x < minX ? x : minX;
        maxX = x > maxX ? x : maxX;
        minY = y < minY ? y : minY;
        maxY = y > maxY ? y : maxY;
        clip |= p.clip[c[k]];
    }
    if (clip != 0) return isBeside(f, p, c) ? PixelBox{0, -1, 0, -1} : PixelBox{0, right, 0, bottom};
    constexpr int kMargin = 4;  // 1/64 px: corners are rounded
    const int fromX = (minX - kMargin + 127) >> 8, toX = (maxX + kMargin - 128) >> 8;
    const int fromY = (minY - kMargin + 127) >> 8, toY = (maxY + kMargin - 128) >> 8;
    return {fromX < 0 ? 0 : fromX, toX > right ? right : toX, fromY < 0 ? 0 : fromY, toY > bottom ? bottom : toY};
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
            const uint32_t cell = 32 * word + static_cast<uint32_t>(__builtin_ctz(left)), at = cellCorner(cell);
            if (boxOfCell(f, p, at).isEmpty()) continue;  // most cells that are less than a pixel
            for (uint32_t k = 0; k < 2; ++k) {
                const uint32_t t = patchTriangle(at, heights[at], heights[at + 1], heights[at + kPatchStride],
                                                 heights[at + kPatchStride + 1], k);
                offerTriangle(f, p, t & 255u, t >> 8 & 255u, t >> 16, {firstId + 2 * cell + k, true, nullptr}, large,
                              visibility);
            }
        }
}
