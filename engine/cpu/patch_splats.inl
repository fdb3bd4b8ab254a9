// Elevation patches of the cpu backend as splats: the pixels of a box, each by its ray. Included by kernels.inl.

constexpr int kSplatStretch = 8;             ///< most splats are a few pixels wide
constexpr int64_t kLargeSplatPixels = 4096;  ///< from this many pixels on a splat's rows are shared out

/// Offers the pixels of rows [firstRow, lastRow] whose rays meet something: hit(ray, more) gives a depth and, in
/// `more`, what is added to the id.
template <typename Hit>
[[gnu::always_inline]] inline void fillBox(const FrameConstants& f, const PixelBox& box, int firstRow, int lastRow,
                                           uint64_t id, const Visibility& visibility, const Hit& hit) {
    const float inverseFocal = 1.0f / f.focal;
    const Lens lens = lensHere(f.focal);
    const int fromY = box.fromY < firstRow ? firstRow : box.fromY, toY = box.toY > lastRow ? lastRow : box.toY;
    for (int y = fromY; y <= toY; ++y) {
        const float ey = (float(y) + 0.5f - f.centre.y) * inverseFocal;
        for (int x0 = box.fromX; x0 <= box.toX; x0 += kSplatStretch) {
            alignas(64) uint32_t depth[kSplatStretch], more[kSplatStretch];
            const int count = box.toX - x0 + 1 < kSplatStretch ? box.toX - x0 + 1 : kSplatStretch;
            const float ex0 = float(x0) + 0.5f - f.centre.x;
#pragma GCC ivdep
            for (size_t k = 0; k < kSplatStretch; ++k)
                depth[k] = floatBitsToUint(hit(pixelRay(lens, (ex0 + float(int(k))) * inverseFocal, ey), more[k]));
            const size_t first = size_t(y) * f.width + size_t(x0);
            const uint32_t none = floatBitsToUint(kNoPatch);
            for (int k = 0; k < count; ++k)
                if (depth[k] < none) offerKey(visibility, first + size_t(k), visibilityKey(depth[k], id + more[k]));
        }
    }
}

/// The two triangles of a cell, corner by corner.
struct CellSplat {
    vec3 a0, a1, a2, b0, b1, b2;
};
/// The disc of a sample.
struct DiscSplat {
    PatchDisc disc;
    DrawMesh mesh;
};

/// Rows [firstRow, lastRow] of one splat.
void fillSplat(const FrameConstants& f, const CellSplat& s, const PixelBox& box, int firstRow, int lastRow, uint64_t id,
               const Visibility& visibility) {
    const float nearPlane = f.nearPlane;
    const CellSplat c = s;
    fillBox(f, box, firstRow, lastRow, id, visibility, [&](const PixelRay& ray, uint32_t& more) {
        const float first = patchTriangleDepth(ray, c.a0, c.a1, c.a2, nearPlane),
                    second = patchTriangleDepth(ray, c.b0, c.b1, c.b2, nearPlane);
        more = second < first ? 1u : 0u;
        return second < first ? second : first;
    });
}
void fillSplat(const FrameConstants& f, const DiscSplat& s, const PixelBox& box, int firstRow, int lastRow, uint64_t id,
               const Visibility& visibility) {
    const float nearPlane = f.nearPlane;
    const DiscSplat d = s;
    fillBox(f, box, firstRow, lastRow, id, visibility, [&](const PixelRay& ray, uint32_t& more) {
        more = 0;
        return patchDiscHit(d.disc, d.mesh, ray, nearPlane).x;
    });
}

/// Pixels around a sphere that holds a disc.
[[gnu::always_inline]] inline PixelBox boxOfDisc(const FrameConstants& f, const PatchDisc& d) {
    const float width = float(int(f.width)), height = float(int(f.height));
    const Lens lens = lensHere(f.focal);
    const float nearest = lensDepth(lens, d.centre.z - d.radius), z = lensDepth(lens, d.centre.z);
    if (d.centre.z + d.radius < f.nearPlane) return {0, -1, 0, -1};
    if (!kOrthographic && !(nearest > f.nearPlane)) return {0, int(width) - 1, 0, int(height) - 1};
    const float reach = 1.001f * d.radius / nearest + 1.0f / f.focal;
    const auto range = [&](float at, float centre, float most, int& from, int& to) {
        const float p = at / z, more = kOrthographic ? reach : reach * (1.0f + std::fabs(p));
        from = int(min(max(0.0f, (p - more) * f.focal + centre), most));
        to = int(min(max(-1.0f, (p + more) * f.focal + centre), most - 1.0f));
    };
    PixelBox box{};
    range(d.centre.x, f.centre.x, width, box.fromX, box.toX);
    range(d.centre.y, f.centre.y, height, box.fromY, box.toY);
    return box;
}

[[gnu::always_inline]] inline CellSplat cellSplat(const PlacedCorners& p, const int32_t* heights, uint32_t at) {
    const auto corners = [&](uint32_t k) {
        return patchTriangle(at, heights[at], heights[at + 1], heights[at + kPatchStride],
                             heights[at + kPatchStride + 1], k);
    };
    const auto place = [&](uint32_t corner) { return vec3(p.x[corner], p.y[corner], p.z[corner]); };
    const uint32_t a = corners(0), b = corners(1);
    return {place(a & 255u), place(a >> 8 & 255u), place(a >> 16),
            place(b & 255u), place(b >> 8 & 255u), place(b >> 16)};
}
/// Bits of the cells around a sample that are drawn (PatchDisc::cells).
[[gnu::always_inline]] inline uint32_t cellsAround(const PatchBlock& block, uint32_t sample) {
    uint32_t bits = 0;
    for (uint32_t quarter = 0; quarter < 4; ++quarter) {
        const uint32_t cell = patchCellAround(sample, quarter);
        if (cell != kNoPatchCell) bits |= (block.cells[cell / 32] >> cell % 32 & 1u) << quarter;
    }
    return bits;
}
[[gnu::always_inline]] inline DiscSplat discSplat(const PatchBlock& block, const vec3& place, uint32_t sample,
                                                  uint32_t cells, const DrawMesh& mesh) {
    return {patchDisc(place, octDecode(block.normals[sample]), sample, cells, mesh), mesh};
}

/// Splats of a block: cells, or, direct, samples. `use(splat, box, lane)`.
template <typename Use>
[[gnu::always_inline]] inline void forSplats(const FrameConstants& f, const PatchSource& source, const Use& use) {
    const PatchBlock& block = *source.block;
    alignas(64) int32_t heights[kPatchRoom];
    PlacedCorners p;
    patchHeights(block, heights);
    placeSamples(block, *source.mesh, heights, p);
    if (f.patchAs == kPatchDirect) {
        for (uint32_t s = 0; s < kPatchSamples; ++s) {
            const uint32_t cells = cellsAround(block, s);
            if (cells == 0) continue;
            const DiscSplat splat = discSplat(block, vec3(p.x[s], p.y[s], p.z[s]), s, cells, *source.mesh);
            const PixelBox box = boxOfDisc(f, splat.disc);
            if (!box.isEmpty()) use(splat, box, s);
        }
        return;
    }
    projectCorners(f, kPatchRoom, p);
    for (uint32_t word = 0; word < 4; ++word)
        for (uint32_t left = block.cells[word]; left != 0; left &= left - 1) {
            const uint32_t cell = 32 * word + static_cast<uint32_t>(__builtin_ctz(left)), at = cellCorner(cell);
            const PixelBox box = boxOfCell(f, p, at);
            if (!box.isEmpty()) use(cellSplat(p, heights, at), box, 2 * cell);
        }
}

void splatPatch(const FrameConstants& frame, const PatchSource& source, uint32_t firstPlace,
                const LargeSplatSink& large, const Visibility& visibility) {
    const FrameConstants f = frame;
    const uint64_t firstId = drawId(f.firstBlock.of[kKindPatches], firstPlace);
    const int last = static_cast<int>(f.height) - 1;
    forSplats(f, source, [&](const auto& s, const PixelBox& box, uint32_t lane) {
        if (int64_t{box.toX - box.fromX + 1} * (box.toY - box.fromY + 1) > kLargeSplatPixels)
            large.keep(large.context, {&source, firstPlace, lane});
        else
            fillSplat(f, s, box, 0, last, firstId + lane, visibility);
    });
}

void splatLarge(const FrameConstants& frame, const LargeSplat* splats, size_t count, uint32_t firstRow,
                uint32_t lastRow, const Visibility& visibility) {
    const FrameConstants f = frame;
    for (size_t i = 0; i < count;) {
        const LargeSplat& of = splats[i];
        const uint64_t firstId = drawId(f.firstBlock.of[kKindPatches], of.firstPlace);
        size_t next = i;  // those of a block follow each other, in the order of lanes
        forSplats(f, *of.source, [&](const auto& s, const PixelBox& box, uint32_t lane) {
            if (next < count && splats[next].source == of.source && splats[next].lane == lane) {
                fillSplat(f, s, box, static_cast<int>(firstRow), static_cast<int>(lastRow), firstId + lane, visibility);
                ++next;
            }
        });
        i = next;
    }
}
