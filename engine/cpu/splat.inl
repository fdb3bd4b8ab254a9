// Discs drawn exactly (shaders/shared/splat_disc.h): the nearest of each pixel. Included by kernels.inl, once per
// instruction set, after disc_batch.inl.

/// The nearest of each pixel of a tile: its depth (by which keys compare, too), and which point, or kOther.
struct TileFront {
    static constexpr uint32_t kOther = ~0u;  ///< of another kind, or nothing
    alignas(64) float depth[kTilePixels];
    alignas(64) uint32_t id[kTilePixels];
};

/// The disc at the pixels of a block. Discs come in the order of their ids: of what is equally deep the first stays.
template <bool isNear>
[[gnu::always_inline]] inline void offerSplat(const DiscBatch& b, size_t i, const float* px, float top,
                                              const TileGrid& grid, const FrameConstants& f, float* __restrict nearest,
                                              uint32_t* __restrict owner) {
    const uint32_t id = b.id[i];
    const DiscForm d = formOf(b, i, f);
    const float midX = b.x[i], dy = top - b.y[i], least = b.least[i], most = b.most[i];
#pragma GCC ivdep
    for (int l = 0; l < kGroup; ++l) {
        const DiscAt at = discAt < isNear || kOrthographic > (d, px[l] - midX, dy + grid.row[l]);
        const float linear = min(max(at.linear, least), most);
        const float depth = kOrthographic ? linear : 1.0f / linear;
        // (Selections between values at hand: of conditions GCC makes masked stores, and what is stored so is not kept
        // in registers.)
        const float offered = at.rho2 <= 1.0f ? depth : kNoDisc, before = nearest[l];
        const uint32_t was = owner[l], mine = offered < before ? ~0u : 0u;
        nearest[l] = min(before, offered);
        owner[l] = (id & mine) | (was & ~mine);
    }
}
template <bool hasNear>
void splatBlock(const DiscBatch& b, uint64_t discs, int block, const TileGrid& grid, const FrameConstants& f,
                TileFront& __restrict front) {
    const int first = block * kGroup;
    const float* const px = grid.x + block % kBlockColumns * kGroup;
    const float top = float(kGroupRows * (block / kBlockColumns)) + grid.top;
    alignas(64) float nearest[kGroup];
    alignas(64) uint32_t owner[kGroup];
    copyGroup(front.depth + first, nearest);
    copyGroup(front.id + first, owner);
    forBits(
        discs, [&](size_t i) __attribute__((always_inline)) {
            if (hasNear && b.isNear[i] > 0.5f)
                offerSplat<true>(b, i, px, top, grid, f, nearest, owner);
            else
                offerSplat<false>(b, i, px, top, grid, f, nearest, owner);
        });
    copyGroup(nearest, front.depth + first);
    copyGroup(owner, front.id + first);
}

/// The discs of a batch, block by block; then the pixels that hold a centre, but whose rays miss.
template <bool hasNear>
void splatBatch(const DiscBatch& b, size_t count, const TileGrid& grid, const FrameConstants& f, TileFront& front) {
    BlockDiscs discs;
    turnBits(b.reached, discs);
    for (int block = 0; block < kTileBlocks; ++block)
        if (discs.of[block] != 0u) splatBlock<hasNear>(b, discs.of[block], block, grid, f, front);
    forMissed(
        b, count, [&](size_t i, int at) __attribute__((always_inline)) { return b.missedDepth[i] <= front.depth[at]; },
        [&](size_t i) __attribute__((always_inline)) {
            const auto at = size_t(b.missed[i]);
            const float depth = b.missedDepth[i];
            if (!(depth < front.depth[at] || (depth == front.depth[at] && b.id[i] < front.id[at]))) return;
            front.depth[at] = depth;
            front.id[at] = b.id[i];
        });
}

void splatTile(const FrameConstants& frame, const PlacedSplat* splats, const uint32_t* places, size_t count,
               const SplatTile& tile, const Visibility& visibility) {
    const FrameConstants f = frame;
    prefetchDiscs(splats, places, count);
    const TileGrid grid = tileGrid(f, tile);
    TileFront front;
    for (size_t i = 0; i < kTilePixels; ++i) {
        front.depth[i] = kNoDisc;
        front.id[i] = TileFront::kOther;
    }
    DiscBatch batch;
    for (size_t first = 0; first < count; first += DiscBatch::kSize) {
        const size_t n = count - first < DiscBatch::kSize ? count - first : DiscBatch::kSize;
        prefetchDiscs(splats, places + first + n, count - first - n);
        prepareDiscs(f, splats, places + first, n, tile, kBetweenPixels, batch);
        if (batch.hasNear)
            splatBatch<true>(batch, n, grid, f, front);
        else
            splatBatch<false>(batch, n, grid, f, front);
    }
    for (uint32_t y = 0; y < tile.height; ++y) {
        const size_t first = (tile.y0 + y) * f.width + tile.x0;
        uint64_t* const keys = visibility.keys + first;
        const int row = tileEntry(0, int(y));
#pragma GCC ivdep
        for (uint32_t x = 0; x < tile.width; ++x) {
            const uint32_t id = front.id[row + kGroupRows * int(x)];
            const uint64_t key = visibilityKey(floatBitsToUint(front.depth[row + kGroupRows * int(x)]), drawId(0u, id));
            keys[x] = id != TileFront::kOther && key < keys[x] ? key : keys[x];
        }
        for (size_t r = first >> Visibility::kRunBits; r <= (first + tile.width - 1) >> Visibility::kRunBits; ++r)
            __atomic_store_n(&visibility.runs[r], uint8_t{1}, __ATOMIC_RELAXED);
    }
}
