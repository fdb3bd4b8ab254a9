// The fronts of a tile: of each pixel the nearest disc, moved back, behind which nothing is blended. Included by
// ewa.inl.

/// The depth at which the pixel that holds the i-th centre, but whose ray misses, shows its disc: the plane's, so that
/// the surface agrees with it.
float missedDepth(const FrameConstants& f, const DiscBatch& b, size_t i) {
    const Lens lens = lensHere(f.focal);
    const float inverseFocal = 1.0f / f.focal;
    const WideDisc d = b.disc(i);
    const DepthRange range = depthRange(d, d.radius * (1.0f / kOpaqueSigmas), f.kernelSupport, f.lowPass, lens);
    const CentrePixel c = centrePixel(d, f);
    const PixelRay ray = pixelRay(lens, (float(c.x) + 0.5f - f.centre.x) * inverseFocal,
                                  (float(c.y) + 0.5f - f.centre.y) * inverseFocal);
    return depthWithin(range, dot(d.normal, fromRay(ray, d.centre)), dot(d.normal, rayDirection(ray)));
}

/// The front of each pixel: of the opaque parts of discs, moved back by `shift` along the ray. Discs come in the order
/// of their ids: of what is equally deep the first stays. `isSecond`: of those behind TileFilter::beyond, in
/// the blocks of `reached`.
template <bool isNear, bool isSecond>
void drawFront(const DiscBatch& b, size_t i, float shift, const FrameConstants& f, TileFilter& __restrict t,
               uint32_t reached = ~0u) {
    const uint32_t id = b.id[i];
    const DiscForm d = formOf(b, i, f);
    const float midX = b.x[i], midY = b.y[i], least = b.least[i], most = b.most[i];
    const int x1 = b.lastX[i], x0 = b.firstX[i] & ~(kGroupColumns - 1);
    for (int band = b.firstY[i] >> kRowBits; band <= b.lastY[i] >> kRowBits; ++band) {
        const float dy = float(kGroupRows * band) + t.grid.top - midY;
        for (int x = x0; x <= x1; x += kGroupColumns) {
            const int first = band * kBandPitch + kGroupRows * x;
            if (isSecond && (reached >> (first / kGroup) & 1u) == 0u) continue;
            float *const front = t.front + first, *const own = t.own + first, *const farthest = t.farthest + first;
            uint32_t* const owner = t.id + first;
            const float *const px = t.grid.x + kGroupRows * x, *const along = t.along + first,
                               *const beyond = t.beyond + first;
#pragma GCC ivdep
            for (int l = 0; l < kGroup; ++l) {
                const DiscAt at = discAt < isNear || kOrthographic > (d, px[l] - midX, dy + t.grid.row[l]);
                const float linear = min(max(at.linear, least), most);
                const float depth = kOrthographic ? linear : 1.0f / linear;
                const bool isHit = isSecond ? (at.rho2 <= 1.0f) & (depth > beyond[l]) : at.rho2 <= 1.0f;
                const float moved = depth + shift * along[l];
                const bool isFront = isHit & (moved < front[l]);
                front[l] = isFront ? moved : front[l];
                owner[l] = isFront ? id : owner[l];
                own[l] = isFront ? depth : own[l];
                farthest[l] = isHit & (depth > farthest[l]) ? depth : farthest[l];
            }
        }
    }
    if (isSecond || b.missed[i] < 0) return;
    const auto at = size_t(b.missed[i]);
    const float depth = missedDepth(f, b, i), moved = depth + shift * t.along[at];
    if (!(moved < t.front[at])) return;
    t.front[at] = moved;
    t.id[at] = id;
    t.own[at] = depth;
}

/// The farthest of the limits of each block.
void closeBlocks(const TileFilter& __restrict t, TileBlocks& __restrict blocks) {
    static_assert(TileBlocks::kEdge == kGroupRows && TileBlocks::kEdge == kGroupColumns);
    for (int b = 0; b < TileBlocks::kColumns * TileBlocks::kRows; ++b) {
        const float* const from = t.limit + b * kGroup;
        float limit = from[0];
        for (int i = 1; i < kGroup; ++i) limit = isNearer(limit, from[i]) ? from[i] : limit;
        blocks.limit[b] = limit;
    }
}

/// Of blocks of second surfaces, which of them begins nearest.
void beginBlocks(const TileFilter& __restrict t, TileBlocks& __restrict blocks) {
    for (int b = 0; b < TileBlocks::kColumns * TileBlocks::kRows; ++b) {
        float begin = kFarthest;
        for (int i = b * kGroup; i < (b + 1) * kGroup; ++i)
            begin = t.limit[i] != kNearest && isNearer(t.nearest[i], begin) ? t.nearest[i] : begin;
        blocks.begin[b] = begin;
    }
}

/// Where fronts end, by pixels and by blocks, and what is before them.
void closeFronts(const SplatTile& tile, const Lens& lens, TileFilter& __restrict t, TileBlocks& __restrict blocks) {
#pragma GCC ivdep
    for (size_t i = 0; i < kTilePixels; ++i) {
        const bool hasFront = t.id[i] != TileFilter::kOther;
        t.limit[i] = hasFront ? imageLinear(lens, t.front[i]) : kFarthest;
        const float nearest = t.own[i] - (t.front[i] - t.own[i]);  // as far before the front as it ends behind it
        const bool isThere = hasFront & (kOrthographic | (nearest > 0.0f));
        t.nearest[i] = isThere ? imageLinear(lens, isThere ? nearest : 1.0f) : kNearest;
    }
    closeBlocks(t, blocks);
    bool hasGaps = false;
    if (tile.width * tile.height == kTilePixels)
        for (size_t i = 0; i < kTilePixels; ++i) hasGaps = hasGaps | (t.id[i] == TileFilter::kOther);
    for (uint32_t y = 0; y < tile.height && tile.width * tile.height < kTilePixels; ++y)
        for (uint32_t x = 0; x < tile.width; ++x)
            hasGaps = hasGaps | (t.id[tileEntry(int(x), int(y))] == TileFilter::kOther);
    t.hasGaps = hasGaps;
}

/// Leaves are no surface: nothing before one is told from it.
void closeLeaves(const BlockSource* blocks, TileFilter& t) {
    for (size_t i = 0; i < kTilePixels; ++i)
        if (t.id[i] != TileFilter::kOther && (recordFlags(recordOf(blocks, t.id[i])) & kFlagLeaf) != 0u)
            t.nearest[i] = kNearest;
}

/// Which blocks discs reach where they lie behind some pixel's TileFilter::beyond.
void markBehind(const TileFilter& t, size_t count, const DiscBatch& b, uint32_t* __restrict reached) {
    constexpr int kBlocks = TileBlocks::kColumns * TileBlocks::kRows;
    float beyond[kBlocks];
    for (int k = 0; k < kBlocks; ++k) beyond[k] = t.blockBeyond[k];
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const uint32_t box = blocksOf(b.firstX[i], b.lastX[i], b.firstY[i], b.lastY[i]);
        const float deepest = kOrthographic ? b.most[i] : 1.0f / b.least[i];
        uint32_t behind = 0u;
#pragma GCC unroll 32
        for (int k = 0; k < kBlocks; ++k) behind |= deepest > beyond[k] ? box & 1u << k : 0u;
        reached[i] = behind;
    }
}
