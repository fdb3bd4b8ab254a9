// The fronts of a tile: of each pixel the nearest disc, moved back, behind which nothing is blended. Included by
// ewa.inl.

/// Fronts of a block, as in TileFilter.
struct BlockFronts {
    alignas(64) float front[kGroup], own[kGroup], farthest[kGroup];
    alignas(64) uint32_t id[kGroup];

    template <typename Use>
    [[gnu::always_inline]] void each(TileFilter& t, int first, const Use& use) {
        use(t.front + first, front);
        use(t.own + first, own);
        use(t.farthest + first, farthest);
        use(t.id + first, id);
    }
};

/// The opaque part of the i-th disc at the pixels of a block, moved back along the ray. Discs come in the order of
/// their ids: of what is equally deep the first stays. `isSecond`: only behind `beyond`.
template <bool isNear, bool isSecond>
[[gnu::always_inline]] inline void offerFront(const KeptBatch& of, size_t i, const float* px, const float* row,
                                              float top, const float* along, const float* beyond,
                                              const FrameConstants& f, BlockFronts& __restrict t) {
    const DiscBatch& b = of.discs;
    const uint32_t id = of.first + uint32_t(i);
    const DiscForm d = formOf(b, i, f);
    const float midX = b.x[i], dy = top - b.y[i], least = b.least[i], most = b.most[i], shift = of.fronts.shift[i];
#pragma GCC ivdep
    for (int l = 0; l < kGroup; ++l) {
        const DiscAt at = discAt < isNear || kOrthographic > (d, px[l] - midX, dy + row[l]);
        const float linear = min(max(at.linear, least), most);
        const float depth = kOrthographic ? linear : 1.0f / linear;
        const bool isHit = isSecond ? (at.rho2 <= 1.0f) & (depth > beyond[l]) : at.rho2 <= 1.0f;
        // (Selections between values at hand: of conditions GCC makes masked stores, and what is stored so is not kept
        // in registers.)
        const float moved = isHit ? depth + shift * along[l] : kNoDisc, front = t.front[l], own = t.own[l];
        const uint32_t before = t.id[l], mine = moved < front ? ~0u : 0u;
        t.front[l] = min(front, moved);
        t.id[l] = (id & mine) | (before & ~mine);
        t.own[l] = uintBitsToFloat((floatBitsToUint(depth) & mine) | (floatBitsToUint(own) & ~mine));
        t.farthest[l] = max(t.farthest[l], isHit ? depth : 0.0f);
    }
}
template <bool hasNear, bool isSecond>
void drawFrontBlock(const KeptBatch& b, uint64_t discs, int block, const FrameConstants& f, TileFilter& __restrict t) {
    const int first = block * kGroup;
    const float *const px = t.grid.x + block % kBlockColumns * kGroup, *const along = t.along + first,
                       *const beyond = t.beyond + first;
    const float top = float(kGroupRows * (block / kBlockColumns)) + t.grid.top;
    BlockFronts fronts;
    fronts.each(
        t, first, [](const auto* of, auto* here) __attribute__((always_inline)) { copyGroup(of, here); });
    forBits(
        discs, [&](size_t i) __attribute__((always_inline)) {
            if (hasNear && b.discs.isNear[i] > 0.5f)
                offerFront<true, isSecond>(b, i, px, t.grid.row, top, along, beyond, f, fronts);
            else
                offerFront<false, isSecond>(b, i, px, t.grid.row, top, along, beyond, f, fronts);
        });
    fronts.each(
        t, first, [](auto* of, const auto* here) __attribute__((always_inline)) { copyGroup(here, of); });
}
/// `reached`: by each disc of the batch, blocks.
template <bool hasNear, bool isSecond>
void drawFrontBatch(const KeptBatch& b, const uint32_t* reached, const FrameConstants& f, TileFilter& t) {
    BlockDiscs discs;
    turnBits(reached, discs);
    for (int block = 0; block < kTileBlocks; ++block)
        if (discs.of[block] != 0u) drawFrontBlock<hasNear, isSecond>(b, discs.of[block], block, f, t);
}

/// The discs of a batch at the pixels that hold their centres, but whose rays miss them.
void showMissed(const KeptBatch& of, size_t count, TileFilter& t) {
    const DiscBatch& b = of.discs;
    const FrontBatch& k = of.fronts;
    const auto movedAt = [&](size_t i, int at) __attribute__((always_inline)) {
        return k.missedDepth[i] + k.shift[i] * t.along[at];
    };
    forMissed(
        b, count, [&](size_t i, int at) __attribute__((always_inline)) { return movedAt(i, at) <= t.front[at]; },
        [&](size_t i) __attribute__((always_inline)) {
            const int at = b.missed[i];
            const float moved = movedAt(i, at);
            const uint32_t id = of.first + uint32_t(i);
            if (!(moved < t.front[at] || (moved == t.front[at] && id < t.id[at]))) return;
            t.front[at] = moved;
            t.id[at] = id;
            t.own[at] = k.missedDepth[i];
            t.missed[at] = id;
            t.place[at] = k.missedPlace[i];
        });
}

/// `a` where `mask` is all ones, `b` where it is 0. (Of conditions GCC makes loads under a mask, and no SIMD.)
[[gnu::always_inline]] inline float chosen(uint32_t mask, float a, float b) {
    return uintBitsToFloat((floatBitsToUint(a) & mask) | (floatBitsToUint(b) & ~mask));
}

/// Where fronts end, by pixels and by blocks, and what is before them. Leaves are no surface: nothing before one is
/// told from it.
void closeFronts(const TileDiscs& discs, const Lens& lens, TileFilter& __restrict t, BlockLimits& __restrict limits) {
    if (discs.hasLeaves)
        for (size_t i = 0; i < kTilePixels; ++i)
            t.isLeaf[i] = t.id[i] != TileFilter::kOther && discs.isLeaf(t.id[i]) ? 1u : 0u;
#pragma GCC ivdep
    for (size_t i = 0; i < kTilePixels; ++i) {
        const bool hasFront = t.id[i] != TileFilter::kOther;
        t.limit[i] = chosen(hasFront ? ~0u : 0u, imageLinear(lens, t.front[i]), kFarthest);
        const float nearest = t.own[i] - (t.front[i] - t.own[i]);  // as far before the front as it ends behind it
        const bool isThere = hasFront & (t.isLeaf[i] == 0u) & (kOrthographic | (nearest > 0.0f));
        t.nearest[i] = chosen(isThere ? ~0u : 0u, imageLinear(lens, nearest), kNearest);
    }
    for (int b = 0; b < kTileBlocks; ++b) {
        const float* const from = t.limit + b * kGroup;
        float limit = from[0];
        for (int i = 1; i < kGroup; ++i) limit = isNearer(limit, from[i]) ? from[i] : limit;
        limits.limit[b] = limit;
    }
    limits.used = ~0u;
    t.gaps = 0u;
    for (int block = 0; block < kTileBlocks; ++block) {
        bool hasGaps = false;
        for (int i = block * kGroup; i < (block + 1) * kGroup; ++i) hasGaps = hasGaps | (t.id[i] == TileFilter::kOther);
        t.gaps |= hasGaps ? 1u << block : 0u;
    }
}

/// Which blocks discs reach where they lie behind some pixel's TileFilter::beyond; of blocks without such a pixel
/// `beyond` is kNoDisc. False: none.
bool markBehind(const float* beyondOf, const DiscBatch& b, uint32_t* __restrict reached) {
    float beyond[kTileBlocks];
    uint32_t used = 0u, any = 0u;
    for (int k = 0; k < kTileBlocks; ++k) {
        beyond[k] = beyondOf[k];
        used |= beyond[k] < kNoDisc ? 1u << k : 0u;
    }
#pragma GCC ivdep
    for (size_t i = 0; i < DiscBatch::kSize; ++i) {
        const uint32_t box = b.reached[i] & used;
        const float deepest = kOrthographic ? b.most[i] : 1.0f / b.least[i];
        uint32_t behind = 0u;
#pragma GCC unroll 32
        for (int k = 0; k < kTileBlocks; ++k) behind |= deepest > beyond[k] ? box & 1u << k : 0u;
        reached[i] = behind;
        any |= behind;
    }
    return any != 0u;
}
