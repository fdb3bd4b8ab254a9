// Discs drawn exactly (shaders/shared/splat_disc.h): the nearest of each pixel. Included by kernels.inl, once per
// instruction set, after disc_batch.inl.

/// The nearest of each pixel of a tile: its depth (by which keys compare, too), and which point, or kOther.
struct TileFront {
    static constexpr uint32_t kOther = ~0u;  ///< of another kind, or nothing
    alignas(64) float depth[kTilePixels];
    alignas(64) uint32_t id[kTilePixels];
};

/// Discs come in the order of their ids: of what is equally deep the first stays.
template <bool isNear>
void drawSplat(const DiscBatch& b, size_t i, const TileGrid& grid, const FrameConstants& f,
               TileFront& __restrict front) {
    const uint32_t id = b.id[i];
    const DiscForm d = formOf(b, i, f);
    const float midX = b.x[i], midY = b.y[i], least = b.least[i], most = b.most[i];
    const int x1 = b.lastX[i], x0 = b.firstX[i] & ~(kGroupColumns - 1);
    for (int band = b.firstY[i] >> kRowBits; band <= b.lastY[i] >> kRowBits; ++band) {
        const float dy = float(kGroupRows * band) + grid.top - midY;
        for (int x = x0; x <= x1; x += kGroupColumns) {
            float* const nearest = front.depth + band * kBandPitch + kGroupRows * x;
            uint32_t* const owner = front.id + band * kBandPitch + kGroupRows * x;
            const float* const px = grid.x + kGroupRows * x;
#pragma GCC ivdep
            for (int l = 0; l < kGroup; ++l) {
                const DiscAt at = discAt < isNear || kOrthographic > (d, px[l] - midX, dy + grid.row[l]);
                const float linear = min(max(at.linear, least), most);
                const float depth = kOrthographic ? linear : 1.0f / linear;
                const bool isFront = (at.rho2 <= 1.0f) & (depth < nearest[l]);
                nearest[l] = isFront ? depth : nearest[l];
                owner[l] = isFront ? id : owner[l];
            }
        }
    }
    if (b.missed[i] < 0) return;
    const auto at = size_t(b.missed[i]);
    if (!(b.cz[i] < front.depth[at])) return;
    front.depth[at] = b.cz[i];
    front.id[at] = id;
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
        prepareDiscs(f, splats, places + first, n, tile, batch);
        for (size_t i = 0; i < n; ++i) {
            if (batch.isNear[i] > 0.5f)
                drawSplat<true>(batch, i, grid, f, front);
            else
                drawSplat<false>(batch, i, grid, f, front);
        }
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
