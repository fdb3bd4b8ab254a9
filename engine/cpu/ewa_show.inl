// What pixels show of the discs that were blended there. Included by ewa.inl.

/// What pixels without any weight show: their front disc itself.
void showOwn(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, uint32_t id,
             FilteredPixel& pixel) {
    const PointRecord& r = recordOf(blocks, id);
    const Lens lens = lensHere(f.focal);
    const WideDisc d = wideDisc(*blocks[id / kBlockLanes].node, r, 1.0f, id, lens);
    const float towards = dot(d.normal, sightTo(lens, d.centre)) > 0.0f ? -1.0f : 1.0f;
    pixel.colour = colourOf(f, tables, blocks, id, r.colour);
    pixel.normal = octEncode(vec3(d.normal.x * towards, d.normal.y * towards, d.normal.z * towards));
    if (f.hasMaterials == 0u) return;
    const uint32_t material = blocks[id / kBlockLanes].materialOf(id % kBlockLanes);
    pixel.cover = (pixel.cover & (kFilteredMaterial - 1u)) | coverOfMaterial(surfaceOfPoint(material));
}

/// Bits of a depth; that of a pixel without a front, no place beyond the disc that counts first there.
uint32_t rimDepth(const FrameConstants& f, const WideDisc& first, uint32_t blended) {
    return floatBitsToUint(max(placeOfMissed(first, uintBitsToFloat(blended)), f.nearPlane));
}

/// Other kinds at the pixels of a tile, before discs were drawn; and what it shows then.
struct TileOthers {
    bool hasAny;
    alignas(64) float depth[kTilePixels];  ///< kNoDisc: none; only if there are any
    uint64_t keys[kTilePixels];
    alignas(64) float shown[kTilePixels];  ///< depth of what is shown; kNoDisc: nothing that is opaque
};

/// What a band of a tile shows of what was added up there; nothing where it is less than half a code of
/// coverage.
struct ShownBand {
    static constexpr int kEntries = kBandPitch;
    alignas(64) float exact[kEntries];       ///< depth of other kinds; kNoDisc: none
    alignas(64) uint32_t isThere[kEntries];  ///< 1: by what was added up; 2: by its front disc alone
    alignas(64) uint32_t colour[kEntries], normal[kEntries], cover[kEntries], id[kEntries], isLeaf[kEntries],
        depth[kEntries];
};
/// `covered`: what a weight of 1 covers; `mostDivided`: by more than that colours are not divided.
template <Wants wants>
void showBand(const Lens& eye, float covered, float mostDivided, int band, const TileFilter& __restrict t,
              ShownBand& __restrict s, float* __restrict shown) {
    const Lens lens = eye;
    const size_t first = size_t(band) * kBandPitch;
#pragma GCC ivdep
    for (size_t k = 0; k < size_t(kBandPitch); ++k) {
        const size_t i = first + k;
        const float weight = t.weight[i], front = t.front[i], exact = s.exact[k];
        const uint32_t code = uint32_t(int(min((weight + t.rims[i]) * covered, 1.0f) * 255.0f + 0.5f));
        // Other kinds win within what the surface may be rough; rims do not show before them.
        const uint32_t isRim = exact < kNoDisc || t.rim[i] == TileFilter::kOther ? 0u : (code + 255u) >> 8;
        const uint32_t isBefore = front < exact ? 1u : 0u;
        const bool hasFront = t.id[i] != TileFilter::kOther, isBlended = weight > kLeastWeight;
        s.isThere[k] = (hasFront ? isBefore : isRim) * (isBlended ? 1u : 2u);
        const float over = 1.0f / (isBlended ? weight : 1.0f), linear = t.linear[i] * over;
        const float mean = kOrthographic ? linear : 1.0f / linear;
        const float within = shownWithin(isBlended ? mean : t.own[i], t.own[i], t.along[i], lens);
        const float ofFront = t.missed[i] == t.id[i] ? t.place[i] : within;
        const float depth = hasFront ? ofFront : mean;
        s.depth[k] = floatBitsToUint(depth);
        shown[i] = hasFront & (isBefore != 0u) ? depth : hasFront | (isRim == 0u) ? exact : kNoDisc;
        const float ofColour = 1.0f / (isBlended ? min(weight, mostDivided) : 1.0f);
        s.colour[k] = packColour(t.red[i] * ofColour, t.green[i] * ofColour, t.blue[i] * ofColour);
        s.normal[k] = wants != Wants::nothing ? octEncode(vec3(t.nx[i], t.ny[i], t.nz[i])) : 0u;
        const float behind = min(max(t.farthest[i], exact < kNoDisc ? kNoDisc : 0.0f), kNoDisc);
        const uint32_t closed = behind > front ? 255u : code;
        s.cover[k] = hasFront ? closed | kFilteredFront : code;
        if (wants == Wants::materials)
            s.cover[k] |= coverOfMaterial(TexelSurface{t.share[i] * over, t.metallic[i] * over, t.roughness[i] * over});
        s.id[k] = hasFront ? t.id[i] : t.rim[i];
        s.isLeaf[k] = hasFront ? t.isLeaf[i] : 2u;
    }
}
template <Wants wants>
void showTile(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const TileDiscs& discs,
              const SplatTile& tile, const TileFilter& t, const Visibility& visibility, FilteredPixel* filtered,
              TileOthers& others) {
    // Weights of surfels add up to what is covered; where that is all of a pixel, to one.
    const bool perSurfel = f.perSurfel != 0u;
    const float covered = perSurfel ? 1.0f : gridWeight(f.kernelSupport), mostDivided = perSurfel ? 1.0f : 3.0e38f;
    ShownBand s;
    for (float& exact : s.exact) exact = kNoDisc;
    // (Keys of points come from here; other kinds were drawn before.)
    const bool hasOthers = f.firstBlock.of[kKindCurves] != f.firstBlock.of[kKindDiscs];
    others.hasAny = hasOthers;
    for (float& depth : others.depth) depth = kNoDisc;
    for (uint32_t y = 0; y < tile.height; y += uint32_t(kGroupRows)) {
        const uint32_t rows = tile.height - y < uint32_t(kGroupRows) ? tile.height - y : uint32_t(kGroupRows);
        const size_t first = size_t{tile.y0 + y} * f.width + tile.x0;
        for (uint32_t r = 0; r < rows && hasOthers; ++r)
            for (size_t x = 0; x < tile.width; ++x) {
                const uint64_t key = visibility.keys[first + r * f.width + x];
                const size_t at = size_t(kGroupRows) * x + r, of = size_t(kBandPitch) * (y / uint32_t(kGroupRows)) + at;
                s.exact[at] = others.depth[of] = key != kNoKey ? keyDepth(key) : kNoDisc;
                others.keys[of] = key;
            }
        showBand<wants>(lensHere(f.focal), covered, mostDivided, int(y) / kGroupRows, t, s, others.shown);
        for (uint32_t r = 0; r < rows; ++r)
            for (size_t x = 0; x < tile.width; ++x) {
                const size_t k = size_t(kGroupRows) * x + r, to = first + r * f.width + x;
                if (s.isThere[k] == 0u) continue;
                FilteredPixel pixel{s.normal[k], s.colour[k], s.cover[k]};
                const uint32_t id = discs.idOf(s.id[k]);
                if (s.isThere[k] == 2u) showOwn(f, tables, blocks, id, pixel);
                if (discs.hasLeaves && (s.isLeaf[k] == 2u ? discs.isLeaf(s.id[k]) : s.isLeaf[k] != 0u))
                    pixel.cover |= kFilteredLeaf;
                filtered[to] = pixel;
                const bool isRim = (s.cover[k] & kFilteredFront) == 0u;
                const uint32_t depth = isRim ? rimDepth(f, discs.disc(s.id[k]), s.depth[k]) : s.depth[k];
                visibility.keys[to] = visibilityKey(depth, drawId(0u, id));
            }
    }
}

/// 1 where no opaque surface is: those of a row and their neighbours make silhouettes.
void openRow(const FrameConstants& frame, const uint64_t* keys, const FilteredPixel* filtered, uint32_t n,
             uint8_t* open) {
    const BlockRanges first = frame.firstBlock;
    for (size_t i = 0; i < n; ++i) {
        const bool isRim = isPointKey(keys[i], first) & ((filtered[i].cover & kFilteredFront) == 0u);
        open[i] = (keys[i] == kNoKey) | isRim ? 1 : 0;
    }
}
