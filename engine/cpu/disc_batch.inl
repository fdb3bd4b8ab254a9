// Discs of a tile, ready to be drawn: what drawing them exactly (splat.inl) and blending them (ewa.inl) share. Included
// by kernels.inl, once per instruction set.
//
// The image of a disc is an ellipse, exactly (EwaKernel without a low-pass), and what is linear on the image of its
// plane is imageLinear of its depth, so that a pixel of it costs one division. Discs that are not wholly before the eye
// have no such image; they meet each pixel's ray.

/// Planes of a tile: bands of rows, column by column, so that kGroup entries are a block of pixels. Groups are such
/// blocks and never parts of two: what one disc wrote there the next one reads at once.
constexpr int kGroup = 16, kRowBits = 2, kGroupRows = 1 << kRowBits, kGroupColumns = kGroup / kGroupRows;
constexpr int kBandPitch = kGroupRows * int(SplatTile::kWidth), kBands = int(SplatTile::kHeight) / kGroupRows;
constexpr size_t kTilePixels = size_t{SplatTile::kWidth} * SplatTile::kHeight;
[[gnu::always_inline]] inline int tileEntry(int x, int y) {
    return (y >> kRowBits) * kBandPitch + kGroupRows * x + (y & (kGroupRows - 1));
}

/// Blocks of 4 x 4 pixels of a tile, a group of entries each. Discs are drawn block by block: what a block holds stays
/// in registers while the discs of a batch that meet it are drawn there.
constexpr int kBlockEdge = kGroupRows, kBlockColumns = int(SplatTile::kWidth) / kBlockEdge,
              kTileBlocks = kBlockColumns * (int(SplatTile::kHeight) / kBlockEdge);

/// The blocks that a box of pixels reaches, a bit each: those of its columns, in each of its rows. Of an empty box,
/// none.
[[gnu::always_inline]] inline uint32_t blocksOf(int firstX, int lastX, int firstY, int lastY) {
    static_assert(kBlockColumns == 8 && kTileBlocks == 32 && kBlockEdge == 4 && kGroupColumns == kBlockEdge);
    const uint32_t left = uint32_t(firstX) >> 2, right = uint32_t(lastX + 4) >> 2, top = uint32_t(firstY) >> 2,
                   bottom = uint32_t(lastY + 4) >> 2;
    const uint32_t columns = (1u << right) - (1u << left);
    const uint32_t ofRow = (top <= 0u && bottom > 0u ? 0xffu : 0u) | (top <= 1u && bottom > 1u ? 0xff00u : 0u) |
                           (top <= 2u && bottom > 2u ? 0xff0000u : 0u) | (top <= 3u && bottom > 3u ? 0xff000000u : 0u);
    return right > left ? (columns & 0xffu) * 0x01010101u & ofRow : 0u;
}

/// Where the pixels of a tile are, px from the principal point.
struct TileGrid {
    alignas(64) float x[kBandPitch];  ///< of a band
    alignas(64) float row[kGroup];    ///< of a band
    float top;                        ///< of the first row
};
[[gnu::always_inline]] inline TileGrid tileGrid(const FrameConstants& f, const SplatTile& tile) {
    TileGrid g;
    for (int i = 0; i < kBandPitch; ++i) g.x[i] = float(i / kGroupRows) + (float(int(tile.x0)) + 0.5f - f.centre.x);
    for (int i = 0; i < kGroup; ++i) g.row[i] = float(i % kGroupRows);
    g.top = float(int(tile.y0)) + 0.5f - f.centre.y;
    return g;
}

/// The pixels of a tile that may lie between two places, px from the principal point. `first`: the tile's.
struct TilePixels {
    int first, last;
};
[[gnu::always_inline]] inline TilePixels tilePixels(float from, float to, float centre, uint32_t first, uint32_t size) {
    const float shift = centre - 0.5f - float(int(first)), most = float(int(size)) - 1.0f;
    // A hundredth is for rounding.
    return {int(std::ceil(min(max(from + shift - 0.01f, 0.0f), most + 1.0f))),
            int(std::floor(min(max(to + shift + 0.01f, -1.0f), most)))};
}
/// Some discs of a tile in camera space, and their images: rho^2 (of radii) and what is linear on the image at
/// (dx, dy) from (x, y): dx^2 alongX + (dy - skew dx)^2 alongY; linear + slopeX dx + slopeY dy.
struct DiscBatch {
    static constexpr size_t kSize = 64;
    alignas(64) float cx[kSize], cy[kSize], cz[kSize], nx[kSize], ny[kSize], nz[kSize], radius[kSize];
    alignas(64) float x[kSize], y[kSize], alongX[kSize], skew[kSize], alongY[kSize], linear[kSize], slopeX[kSize],
        slopeY[kSize], least[kSize], most[kSize], isNear[kSize];
    alignas(64) uint32_t reached[kSize];   ///< blocks that it may meet; none of what is beyond the batch's end
    alignas(64) int missed[kSize];         ///< entry of the pixel that holds the centre, but whose ray misses; else -1
    alignas(64) float missedDepth[kSize];  ///< ownDepth there
    alignas(64) uint32_t id[kSize], alone[kSize];
    bool hasNear;  ///< some are not wholly before the eye
    WideDisc disc(size_t i) const { return {vec3(cx[i], cy[i], cz[i]), vec3(nx[i], ny[i], nz[i]), radius[i], 0u}; }
};

/// Boxes of pixels of a tile.
struct BatchBoxes {
    alignas(64) int firstX[DiscBatch::kSize], lastX[DiscBatch::kSize], firstY[DiscBatch::kSize],
        lastY[DiscBatch::kSize];
    void set(size_t i, const TilePixels& columns, const TilePixels& rows) {
        firstX[i] = columns.first;
        lastX[i] = columns.last;
        firstY[i] = rows.first;
        lastY[i] = rows.last;
    }
};
void reachBlocks(const BatchBoxes& boxes, size_t count, uint32_t* __restrict reached) {
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i)
        reached[i] = blocksOf(boxes.firstX[i], boxes.lastX[i], boxes.firstY[i], boxes.lastY[i]);
    for (size_t i = count; i < DiscBatch::kSize; ++i) reached[i] = 0u;
}

/// Of each block of a tile, which discs of a batch are drawn there, a bit each.
struct BlockDiscs {
    alignas(64) uint64_t of[kTileBlocks];
};
/// Changes the bits of words that are `apart` from each other: those of the lower ones whose index has that bit,
/// against those of the higher ones whose index has not.
template <int apart>
[[gnu::always_inline]] inline void exchangeBits(uint64_t* words) {
    constexpr uint64_t lower = ~uint64_t{0} / ((uint64_t{1} << apart) + 1u);
    for (int first = 0; first < kTileBlocks; first += 2 * apart)
        for (int k = first; k < first + apart; ++k) {
            const uint64_t changed = ((words[k] >> apart) ^ words[k + apart]) & lower;
            words[k + apart] ^= changed;
            words[k] ^= changed << apart;
        }
}
/// Turns bits of blocks, a word a disc, into bits of discs, a word a block.
void turnBits(const uint32_t* reached, BlockDiscs& __restrict out) {
    static_assert(DiscBatch::kSize == 64 && kTileBlocks == 32);
    for (int i = 0; i < kTileBlocks; ++i) out.of[i] = reached[i] | uint64_t{reached[i + kTileBlocks]} << 32;
    exchangeBits<16>(out.of);
    exchangeBits<8>(out.of);
    exchangeBits<4>(out.of);
    exchangeBits<2>(out.of);
    exchangeBits<1>(out.of);
}
/// Calls use(i) for each bit, the lowest first.
template <typename Use>
[[gnu::always_inline]] inline void forBits(uint64_t bits, const Use& use) {
    for (; bits != 0u; bits &= bits - 1u) use(size_t(__builtin_ctzll(bits)));
}
template <typename T>
[[gnu::always_inline]] inline void copyGroup(const T* from, T* __restrict to) {
    for (int l = 0; l < kGroup; ++l) to[l] = from[l];
}

/// What is linear on the image of a plane: at the disc's centre, and its slopes a px.
struct PlaneImage {
    float slopeX, slopeY;
};
[[gnu::always_inline]] inline PlaneImage planeImage(const WideDisc& d, float inverseFocal) {
    const float ahead = kOrthographic ? -d.normal.z : dot(d.normal, d.centre);
    const float over = inverseFocal / (abs(ahead) > 1.0e-30f ? ahead : 1.0e-30f);
    return {d.normal.x * over, d.normal.y * over};
}

/// In perspective, discs about the eye have the principal point for their (x, y): what is linear on the image there.
[[gnu::always_inline]] inline float planeAtAxis(const WideDisc& d) {
    const float ahead = dot(d.normal, d.centre);
    return d.normal.z / (abs(ahead) > 1.0e-30f ? ahead : 1.0e-30f);
}

/// Where the ray of a pixel meets the plane, and rho^2. (dx, dy): from the disc's (x, y).
struct DiscAt {
    float linear, rho2;
};
struct DiscForm {
    vec3 centre;
    float over2, inverseFocal, nearPlane;  // over2: one over its radius squared
    float alongX, skew, alongY, linear, slopeX, slopeY;
};
/// `byRay`: where the ray meets the plane, not by the ellipse: of discs about the eye, and in orthographic views, where
/// it costs no division and thin ellipses lose nothing to rounding.
template <bool byRay>
[[gnu::always_inline]] inline DiscAt discAt(const DiscForm& d, float dx, float dy) {
    const float linear = d.linear + (d.slopeX * dx + d.slopeY * dy);
    if (byRay) {
        const float plane = kOrthographic ? linear : 1.0f / linear, ex = dx * d.inverseFocal, ey = dy * d.inverseFocal;
        const float ox = kOrthographic ? ex : plane * ex - d.centre.x,
                    oy = kOrthographic ? ey : plane * ey - d.centre.y, oz = plane - d.centre.z;
        return {linear, plane > d.nearPlane ? (ox * ox + oy * oy + oz * oz) * d.over2 : kNoDisc};
    }
    const float across = dy - d.skew * dx;
    return {linear, dx * dx * d.alongX + across * across * d.alongY};
}
[[gnu::always_inline]] inline DiscForm formOf(const DiscBatch& b, size_t i, const FrameConstants& f) {
    return {vec3(b.cx[i], b.cy[i], b.cz[i]),
            1.0f / (b.radius[i] * b.radius[i]),
            1.0f / f.focal,
            f.nearPlane,
            b.alongX[i],
            b.skew[i],
            b.alongY[i],
            b.linear[i],
            b.slopeX[i],
            b.slopeY[i]};
}

/// Is one of `count` flags (0 or 1) set?
inline bool hasSome(const float* flags, size_t count) {
    uint32_t any = 0u;
    for (size_t i = 0; i < count; ++i) any |= flags[i] > 0.5f ? 1u : 0u;
    return any != 0u;
}

/// Of discs about the eye, one by one.
void prepareNear(const FrameConstants& f, size_t count, const SplatTile& tile, float between, DiscBatch& b,
                 BatchBoxes& boxes) {
    const float far = 1.0e6f, inverseFocal = 1.0f / f.focal;
    const Lens lens = lensHere(f.focal);
    b.hasNear = hasSome(b.isNear, count);
    for (size_t i = 0; i < count && b.hasNear; ++i) {
        if (!(b.isNear[i] > 0.5f)) continue;
        const WideDisc d = b.disc(i);
        if (!kOrthographic) {
            b.x[i] = b.y[i] = 0.0f;
            b.linear[i] = planeAtAxis(d);
        }
        b.least[i] = 0.0f;
        b.most[i] = 3.0e38f;
        const vec2 across = discSlopes(lens, d.centre.x, d.centre.z, d.normal.x, d.normal.z, d.radius);
        const vec2 down = discSlopes(lens, d.centre.y, d.centre.z, d.normal.y, d.normal.z, d.radius);
        const auto px = [&](float slope) { return min(max(slope * f.focal, -far), far); };
        const TilePixels columns = tilePixels(px(across.x), px(across.y), f.centre.x, tile.x0, tile.width),
                         rows = tilePixels(px(down.x), px(down.y), f.centre.y, tile.y0, tile.height);
        boxes.set(i, columns, rows);
        const CentrePixel c = centrePixel(d, f);
        const int atX = c.x - int(tile.x0), atY = c.y - int(tile.y0);
        const bool isHere = c.x >= 0 && atX >= 0 && atX < int(tile.width) && atY >= 0 && atY < int(tile.height);
        const PixelRay ray = pixelRay(lens, (float(c.x) + 0.5f - f.centre.x) * inverseFocal,
                                      (float(c.y) + 0.5f - f.centre.y) * inverseFocal);
        const DiscHit hit = discHit(d, ray, f.nearPlane);
        b.missedDepth[i] = ownDepth(d, ray, f);
        const bool isSmall = b.alone[i] != 0u || d.radius * f.focal < between * lensDepth(lens, d.centre.z);
        b.missed[i] = isHere && isSmall && !(hit.rho2 <= 1.0f) ? tileEntry(atX, atY) : -1;
    }
}

/// Discs of a tile lie here and there in memory: those of the next batch are asked for while one is drawn.
[[gnu::always_inline]] inline void prefetchDiscs(const PlacedSplat* splats, const uint32_t* places, size_t count) {
    const size_t n = count < DiscBatch::kSize ? count : DiscBatch::kSize;
    for (size_t i = 0; i < n; ++i) __builtin_prefetch(&splats[places[i]]);
}

/// The discs at these places, as planes. (One by one into a batch's own memory, from where GCC turns eight words of
/// each at a time.)
void takeSplats(const PlacedSplat* splats, const uint32_t* places, size_t count, DiscBatch& __restrict b) {
    static_assert(sizeof(PlacedSplat) == 8 * sizeof(float));
    alignas(64) PlacedSplat own[DiscBatch::kSize];
    for (size_t i = 0; i < count; ++i) own[i] = splats[places[i]];
    for (size_t i = count; i < DiscBatch::kSize; ++i) own[i] = PlacedSplat{};
    const float* const words = &own[0].cx;
#pragma GCC ivdep
    for (size_t i = 0; i < DiscBatch::kSize; ++i) {
        b.cx[i] = words[8 * i];
        b.cy[i] = words[8 * i + 1];
        b.cz[i] = words[8 * i + 2];
        b.nx[i] = words[8 * i + 3];
        b.ny[i] = words[8 * i + 4];
        b.nz[i] = words[8 * i + 5];
        b.radius[i] = words[8 * i + 6];
        const uint32_t id = floatBitsToUint(words[8 * i + 7]);
        b.id[i] = id & ~kAlone;
        b.alone[i] = id & kAlone;
    }
}

/// `between`: radius, px, from which a disc that does not stand alone is not shown at its centre's pixel if that misses
/// it.
void prepareDiscs(const FrameConstants& frame, const PlacedSplat* splats, const uint32_t* places, size_t count,
                  const SplatTile& tile, float between, DiscBatch& __restrict b) {
    const FrameConstants f = frame;
    takeSplats(splats, places, count, b);
    const float left = float(int(tile.x0)), top = float(int(tile.y0)), lastX = float(int(tile.width)) - 1.0f,
                lastY = float(int(tile.height)) - 1.0f;
    const float focal = f.focal, inverseFocal = 1.0f / focal, nearPlane = f.nearPlane;
    const Lens lens = lensHere(focal);
    BatchBoxes boxes;
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const vec3 centre(b.cx[i], b.cy[i], b.cz[i]);
        const WideDisc d{centre, vec3(b.nx[i], b.ny[i], b.nz[i]), b.radius[i], 0u};
        const EwaKernel k = ewaKernel(d, d.radius, 1.0f, 0.0f, lens);
        const PlaneImage plane = planeImage(d, inverseFocal);
        const float toImage = focal / lensDepth(lens, centre.z);
        const float midX = centre.x * toImage, midY = centre.y * toImage;
        // No farther than the disc's rim, whatever rounding makes of planes that are seen edge-on.
        const float slab = discReach(d);
        const float nearest = centre.z - slab, farthest = centre.z + slab;
        b.x[i] = k.x;
        b.y[i] = k.y;
        b.alongX[i] = k.alongX;
        b.skew[i] = k.skew;
        b.alongY[i] = k.alongY;
        b.linear[i] = imageLinear(lens, centre.z) + (plane.slopeX * (k.x - midX) + plane.slopeY * (k.y - midY));
        b.slopeX[i] = plane.slopeX;
        b.slopeY[i] = plane.slopeY;
        b.least[i] = kOrthographic ? nearest : 1.0f / farthest;
        b.most[i] = kOrthographic ? farthest : 1.0f / nearest;
        b.isNear[i] = max(k.isNear, nearest > nearPlane ? 0.0f : 1.0f);
        const TilePixels columns = tilePixels(k.x - k.halfX, k.x + k.halfX, f.centre.x, tile.x0, tile.width);
        const TilePixels rows = tilePixels(k.y - k.halfY, k.y + k.halfY, f.centre.y, tile.y0, tile.height);
        boxes.set(i, columns, rows);
        // Where the ray of the centre's pixel misses a small disc, that pixel shows it all the same.
        const float atX = std::floor(midX + f.centre.x) - left, atY = std::floor(midY + f.centre.y) - top;
        const float dx = atX + (left + 0.5f - f.centre.x - k.x), dy = atY + (top + 0.5f - f.centre.y - k.y),
                    across = dy - k.skew * dx;
        const float within = min(min(atX, lastX - atX), min(atY, lastY - atY));
        const bool isMet = dx * dx * k.alongX + across * across * k.alongY <= 1.0f;
        const float reach = b.alone[i] != 0u ? 0.0f : d.radius * toImage;
        const float misses = isMet | (reach >= between) ? -1.0f : within;
        const int entry = tileEntry(int(min(max(atX, 0.0f), lastX)), int(min(max(atY, 0.0f), lastY)));
        b.missed[i] = misses >= 0.0f ? entry : -1;
        const float beyond = farthest + kPlanePixels / toImage;  // as in ownDepth
        const float there = b.linear[i] + (b.slopeX[i] * dx + b.slopeY[i] * dy);
        const float onPlane =
            kOrthographic ? min(max(there, nearest), beyond) : 1.0f / min(max(there, 1.0f / beyond), b.most[i]);
        b.missedDepth[i] = onPlane + kThicknessRadii * d.radius;
    }
    prepareNear(f, count, tile, between, b, boxes);
    reachBlocks(boxes, count, b.reached);
}

/// Calls use(i) for the discs of a batch that the pixel of their centre may show though its ray misses them: those for
/// which mayShow(i, that pixel's entry) says so before any of them is shown. (Few do; which, is told without branches.)
template <typename MayShow, typename Use>
[[gnu::always_inline]] inline void forMissed(const DiscBatch& b, size_t count, const MayShow& mayShow, const Use& use) {
    alignas(64) int at[DiscBatch::kSize];
    alignas(64) uint32_t may[DiscBatch::kSize];
    for (size_t i = 0; i < DiscBatch::kSize; ++i) at[i] = -1;
    for (size_t i = 0; i < count; ++i) at[i] = b.missed[i];
#pragma GCC ivdep
    for (size_t i = 0; i < DiscBatch::kSize; ++i) {
        const uint32_t isShown = mayShow(i, at[i] < 0 ? 0 : at[i]) ? 1u : 0u;
        may[i] = at[i] >= 0 ? isShown : 0u;
    }
    for (size_t i = 0; i < DiscBatch::kSize; i += 4)
        if ((may[i] | may[i + 1] | may[i + 2] | may[i + 3]) != 0u)
            for (size_t k = i; k < i + 4; ++k)
                if (may[k] != 0u) use(k);
}
