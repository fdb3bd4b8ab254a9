// Second surfaces of a tile's pixels (shaders/shared/ewa.h): where the front ends, what is behind it; before what is
// in front, rims that are not opaque there. Included by ewa.inl.

/// Does one of nine pixels about (x, y) show nothing opaque, or what is deeper than `limit`?
bool isAtJump(const FrameConstants& f, const uint64_t* keys, const FilteredPixel* filtered, uint32_t x, uint32_t y,
              float limit) {
    const uint32_t x0 = x > 0 ? x - 1 : 0, x1 = x + 1 < f.width ? x + 1 : x, y0 = y > 0 ? y - 1 : 0,
                   y1 = y + 1 < f.height ? y + 1 : y;
    for (uint32_t row = y0; row <= y1; ++row)
        for (uint32_t column = x0; column <= x1; ++column) {
            const size_t at = size_t{row} * f.width + column;
            const uint64_t key = keys[at];
            if (key == kNoKey || keyDepth(key) > limit) return true;
            if (isPointKey(key, f.firstBlock) && (filtered[at].cover & kFilteredFront) == 0u) return true;
        }
    return false;
}

/// The same of a pixel of a tile that is not at its edge.
bool isAtJump(const TileOthers& others, int x, int y, float limit) {
    float deepest = 0.0f;
    for (int row = y - 1; row <= y + 1; ++row)
        for (int column = x - 1; column <= x + 1; ++column)
            deepest = max(deepest, others.shown[tileEntry(column, row)]);
    return deepest > limit;
}

/// The pixels of a tile that may show a second surface.
struct TileSeconds {
    struct Pixel {
        uint16_t entry;  ///< of the tile's planes
        uint8_t x, y, kind;
        bool isShown;  ///< its front is, and no other kind
    };
    size_t count = 0;
    Pixel of[kTilePixels];
};

/// By what was added up: which kind of second surface there may be, of each entry. False: none at all.
bool findSeconds(float covered, const TileFilter& __restrict t, const TileOthers& __restrict others,
                 uint32_t* __restrict kind) {
    uint32_t any = 0;
    const bool hasOthers = others.hasAny;
#pragma GCC ivdep
    for (size_t i = 0; i < kTilePixels; ++i) {
        const float exact = hasOthers ? others.depth[i] : kNoDisc, front = t.front[i];
        const bool isShown = (t.id[i] != TileFilter::kOther) & (front < exact), isOther = !isShown & (exact < kNoDisc);
        const float before = (t.rims[i] * (isShown | isOther ? 1.0f : 0.0f) + (isOther ? t.weight[i] : 0.0f)) * covered;
        const float behind = max(t.farthest[i], exact < kNoDisc ? exact : 0.0f);
        const float left = 1.0f - t.weight[i] * covered;
        const bool ends = isShown & (left >= max(kLeastShare, before)) & (behind > front);
        kind[i] = ends ? kSecondBehind : before >= kLeastShare ? kSecondBefore : kSecondNone;
        any |= kind[i];
    }
    return any != 0u;
}

/// Those of the tile whose fronts may end there; of leaves none do. (Beside the tile they may.)
void listSeconds(const SplatTile& tile, const TileFilter& t, const TileOthers& others, const uint32_t* kind,
                 TileSeconds& out) {
    for (uint32_t y = 0; y < tile.height; ++y)
        for (uint32_t x = 0; x < tile.width; ++x) {
            const auto i = size_t(tileEntry(int(x), int(y)));
            if (kind[i] == kSecondNone) continue;
            if (kind[i] == kSecondBehind) {
                const bool isAtEdge = x == 0 || y == 0 || x + 1 == tile.width || y + 1 == tile.height;
                if (!isAtEdge && !isAtJump(others, int(x), int(y), t.front[i])) continue;
                if (t.isLeaf[i] != 0u) continue;
            }
            const bool isShown = t.id[i] != TileFilter::kOther && (!others.hasAny || t.front[i] < others.depth[i]);
            out.of[out.count++] = {uint16_t(i), uint8_t(x), uint8_t(y), uint8_t(kind[i]), isShown};
        }
}

/// Begins the blocks that show second surfaces, and no others.
void beginSeconds(const TileFilter& t, const TileSeconds& seconds, TileFilter& second) {
    second.grid = t.grid;
    uint32_t begun = 0u;
    for (size_t s = 0; s < seconds.count; ++s) {
        const int block = seconds.of[s].entry / kGroup;
        if ((begun >> block & 1u) != 0u) continue;
        begun |= 1u << block;
        clearBlock(block, second);
        copyGroup(t.along + block * kGroup, second.along + block * kGroup);
    }
}

/// The fronts of second surfaces behind fronts.
void findSecondFronts(const FrameConstants& f, const TileDiscs& discs, const SplatTile& tile, const TileFilter& t,
                      const TileSeconds& seconds, TileFilter& second) {
    bool anyBehind = false;
    float beyond[kTileBlocks];
    for (float& of : beyond) of = kNoDisc;
    for (size_t s = 0; s < seconds.count; ++s) {
        const size_t i = seconds.of[s].entry;
        if (seconds.of[s].kind != kSecondBehind || !(t.farthest[i] > t.front[i])) continue;
        second.beyond[i] = t.front[i];
        beyond[i / kGroup] = min(beyond[i / kGroup], t.front[i]);
        anyBehind = true;
    }
    if (anyBehind) drawSecondFronts(f, discs, tile, beyond, second);
}

/// Between which depths second surfaces are added up; those that are fronts of their own get theirs. False: nothing is
/// to be added up.
bool limitSeconds(const FrameConstants& f, const TileFilter& t, const TileOthers& others, TileSeconds& seconds,
                  TileFilter& second, BlockLimits& limits) {
    for (int block = 0; block < kTileBlocks; ++block) {
        limits.limit[block] = limits.before[block] = kNearest;
        limits.begin[block] = kFarthest;
    }
    limits.used = 0u;
    const auto extend = [](float& limit, float to) { limit = isNearer(limit, to) ? to : limit; };
    const Lens lens = lensHere(f.focal);
    for (size_t s = 0; s < seconds.count; ++s) {
        TileSeconds::Pixel& pixel = seconds.of[s];
        const size_t i = pixel.entry, block = i / kGroup;
        const float exact = others.hasAny ? others.depth[i] : kNoDisc;
        if (pixel.kind == kSecondBefore) {
            second.limit[i] = pixel.isShown ? t.nearest[i] : kFarthest;
            if (!pixel.isShown) second.bound[i] = exact;
            extend(limits.before[block], second.limit[i]);
        } else if (second.id[i] != TileFilter::kOther && second.front[i] < exact) {
            second.limit[i] = imageLinear(lens, second.front[i]);
            second.nearest[i] = t.limit[i];
            extend(limits.limit[block], second.limit[i]);
            if (isNearer(second.nearest[i], limits.begin[block])) limits.begin[block] = second.nearest[i];
        } else {
            pixel.kind = exact < kNoDisc ? kSecondFront : kSecondNone;
            continue;
        }
        limits.used |= 1u << block;
    }
    return limits.used != 0u;
}

/// What was added up at an entry, but for how much of the pixel it is.
template <Wants wants>
SecondPixel secondOf(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const TileDiscs& discs,
                     float mostDivided, const TileFilter& t, size_t i) {
    SecondPixel out{};
    const float weight = t.weight[i];
    const uint32_t id = t.id[i] != TileFilter::kOther ? t.id[i] : t.rim[i];
    if (weight > kLeastWeight) {
        const float over = 1.0f / weight, linear = t.linear[i] * over, ofColour = 1.0f / min(weight, mostDivided);
        out.depth = kOrthographic ? linear : 1.0f / linear;
        out.shown.colour = packColour(t.red[i] * ofColour, t.green[i] * ofColour, t.blue[i] * ofColour);
        out.shown.normal = wants != Wants::nothing ? octEncode(vec3(t.nx[i], t.ny[i], t.nz[i])) : 0u;
        if (wants == Wants::materials)
            out.shown.cover =
                coverOfMaterial(TexelSurface{t.share[i] * over, t.metallic[i] * over, t.roughness[i] * over});
    } else {
        out.depth = t.own[i];
        showOwn(f, tables, blocks, discs.idOf(id), out.shown);
    }
    if (discs.hasLeaves && discs.isLeaf(id)) out.shown.cover |= kFilteredLeaf;
    return out;
}

/// Second surfaces of a tile whose pixels are shown. (Whether fronts end at its edges is not known here: they may.)
template <Wants wants>
void showSeconds(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const TileDiscs& discs,
                 const SplatTile& tile, const TileFilter& t, const TileOthers& others, const Visibility& visibility,
                 const FilteredPixel* filtered, const SecondPixels& out) {
    const bool perSurfel = f.perSurfel != 0u;
    const float covered = perSurfel ? 1.0f : gridWeight(f.kernelSupport), mostDivided = perSurfel ? 1.0f : 3.0e38f;
    alignas(64) uint32_t kind[kTilePixels];
    if (!findSeconds(covered, t, others, kind)) return;
    TileSeconds seconds;
    listSeconds(tile, t, others, kind, seconds);
    if (seconds.count == 0) return;
    TileFilter second;
    beginSeconds(t, seconds, second);
    findSecondFronts(f, discs, tile, t, seconds, second);
    BlockLimits limits;
    if (limitSeconds(f, t, others, seconds, second, limits)) {
        if (others.hasAny)
            addKernels<wants, Sum::secondBound>(f, tables, blocks, discs, tile, limits, second);
        else
            addKernels<wants, Sum::second>(f, tables, blocks, discs, tile, limits, second);
    }
    uint32_t next = out.take(uint32_t(seconds.count));
    for (size_t s = 0; s < seconds.count; ++s) {
        const TileSeconds::Pixel& pixel = seconds.of[s];
        const size_t i = pixel.entry, to = (size_t{tile.y0} + pixel.y) * f.width + tile.x0 + pixel.x;
        if (pixel.kind == kSecondNone) continue;
        SecondPixel shown{};
        if (pixel.kind == kSecondFront) {
            shown.shown = filtered[to];
            shown.depth = keyDepth(visibility.keys[to]);
            shown.key = others.keys[i];
            shown.share = min(t.weight[i] * covered, 1.0f);
        } else {
            const float share = min(second.weight[i] * covered, 1.0f);
            if (pixel.kind == kSecondBefore && share < kLeastShare) continue;
            shown = secondOf<wants>(f, tables, blocks, discs, mostDivided, second, i);
            shown.share = pixel.kind == kSecondBefore ? share : 1.0f - min(t.weight[i] * covered, 1.0f);
        }
        shown.limit = t.front[i];
        out.list[next] = shown;
        out.places[to] = next++;
        out.kinds[to] = pixel.kind;
        __atomic_store_n(&out.runs[to >> Visibility::kRunBits], uint8_t{1}, __ATOMIC_RELAXED);
    }
}
