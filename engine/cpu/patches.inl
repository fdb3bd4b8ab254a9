// Elevation patches of the cpu backend: blocks of cells as triangles. Included by kernels.inl.

/// Samples of a block, and what fills them up to whole groups of 16: places of the row beyond the last.
constexpr size_t kPatchRoom = (kPatchSamples + 15) / 16 * 16;
struct SamplePlaces {
    alignas(64) int32_t i[kPatchRoom] = {}, j[kPatchRoom] = {};
    constexpr SamplePlaces() {
        for (size_t s = 0; s < kPatchRoom; ++s) {
            i[s] = static_cast<int32_t>(s % kPatchStride);
            j[s] = static_cast<int32_t>(s / kPatchStride);
        }
    }
};
constexpr SamplePlaces kSamplePlaces;

/// Codes of a block's samples.
[[gnu::always_inline]] inline void patchHeights(const PatchBlock& block, int32_t* __restrict heights) {
    constexpr size_t kWords = (kPatchSamples + 1) / 2;
    for (size_t k = 0; k < kWords; ++k) {
        heights[2 * k] = static_cast<int32_t>(block.heights[k] & 0xffffu);
        heights[2 * k + 1] = static_cast<int32_t>(block.heights[k] >> 16);
    }
    for (size_t s = 2 * kWords; s < kPatchRoom; ++s) heights[s] = 0;
}
[[gnu::always_inline]] inline int32_t patchHeight(const PatchBlock& block, uint32_t sample) {
    return static_cast<int32_t>(block.heights[sample / 2] >> (16 * (sample % 2)) & 0xffffu);
}

/// Places of all samples of a block; those that are not there lie on the plane.
[[gnu::always_inline]] inline void placeSamples(const PatchBlock& block, const DrawMesh& mesh,
                                                const int32_t* __restrict heights, PlacedCorners& __restrict p) {
    const DrawMesh m = mesh;
    const int i0 = static_cast<int>(block.place & 0xffffu), j0 = static_cast<int>(block.place >> 16);
#pragma GCC ivdep
    for (size_t s = 0; s < kPatchRoom; ++s) {
        const vec3 c = meshPosition(i0 + kSamplePlaces.i[s], j0 + kSamplePlaces.j[s], heights[s], m);
        p.x[s] = c.x;
        p.y[s] = c.y;
        p.z[s] = c.z;
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

/// The triangles k of 16 cells beside each other, `at` being the lower left corner of the first. `cells`: a bit for
/// each that is drawn.
template <uint32_t k>
[[gnu::always_inline]] inline void takeCells(const PlacedCorners& p, const int32_t* __restrict heights, size_t at,
                                             uint32_t cells, SmallTriangles& __restrict t) {
    const size_t up = at + kPatchStride;
    const int32_t *const h0 = heights + at, *const h1 = h0 + 1, *const h2 = heights + up, *const h3 = h2 + 1;
#pragma GCC ivdep
    for (size_t i = 0; i < kPatchCellsAcross; ++i) {
        // Corners are as patchTriangle has them; of its first triangle the last one says which way the cell is divided.
        const bool isRising = patchTriangle(0, h0[i], h1[i], h2[i], h3[i], 0) >> 16 == kPatchStride + 1;
        const auto take = [&](const auto* of, auto* a, auto* b, auto* c) {
            const auto corner = of[at + i], right = of[at + i + 1], above = of[up + i], across = of[up + i + 1];
            a[i] = k == 0 || isRising ? corner : right;
            b[i] = k == 0 ? right : across;
            c[i] = k == 1 || !isRising ? above : across;
        };
        take(p.px, t.x[0], t.x[1], t.x[2]);
        take(p.py, t.y[0], t.y[1], t.y[2]);
        take(p.inverse, t.inverse[0], t.inverse[1], t.inverse[2]);
        t.isClipped[i] = p.clip[at + i] | p.clip[at + i + 1] | p.clip[up + i] | p.clip[up + i + 1];
        t.isGiven[i] = cells >> i & 1u;
    }
}

/// Those that SmallTriangles leaves.
void offerLarger(const FrameConstants& f, const PlacedCorners& p, const int32_t* heights, const SmallTriangles& t,
                 uint32_t firstCell, uint32_t k, uint64_t firstId, const LargeSink& large,
                 const Visibility& visibility) {
    for (uint32_t i = 0; i < kPatchCellsAcross; ++i) {
        if (t.isLeft[i] == 0) continue;
        const uint32_t at = cellCorner(firstCell + i);
        if (t.isClipped[i] != 0 && boxOfCell(f, p, at).isEmpty()) continue;
        const uint32_t c = patchTriangle(at, heights[at], heights[at + 1], heights[at + kPatchStride],
                                         heights[at + kPatchStride + 1], k);
        offerTriangle(f, p, c & 255u, c >> 8 & 255u, c >> 16, {firstId + 2 * (firstCell + i) + k, true, nullptr}, large,
                      visibility);
    }
}

void rasterPatch(const FrameConstants& frame, const PatchSource& source, uint32_t firstPlace, const LargeSink& large,
                 const Visibility& visibility) {
    const FrameConstants f = frame;
    const PatchBlock& block = *source.block;
    alignas(64) int32_t heights[kPatchRoom];
    PlacedCorners p;
    patchHeights(block, heights);
    placeSamples(block, *source.mesh, heights, p);
    projectCorners(f, kPatchRoom, p);
    const uint64_t firstId = drawId(f.firstBlock.of[kKindPatches], firstPlace);
    SmallTriangles t;
    const auto draw = [&](uint32_t firstCell, uint32_t k) {
        const SmallBoxes boxes = findSmallBoxes(f, t);
        fillSmall(f, t, boxes, visibility, [&](size_t i) { return firstId + 2 * (firstCell + i) + k; });
        if (boxes.isAnyLeft) offerLarger(f, p, heights, t, firstCell, k, firstId, large, visibility);
    };
    static_assert(kPatchCellsAcross == SmallTriangles::kCount);
    for (uint32_t row = 0; row < kPatchCellsUp; ++row) {
        const uint32_t cells = block.cells[row / 2] >> (kPatchCellsAcross * (row % 2)) & 0xffffu;
        if (cells == 0) continue;
        const uint32_t firstCell = kPatchCellsAcross * row;
        takeCells<0>(p, heights, cellCorner(firstCell), cells, t);
        draw(firstCell, 0);
        takeCells<1>(p, heights, cellCorner(firstCell), cells, t);
        draw(firstCell, 1);
    }
}
