// Discs blended by their kernels (shaders/shared/ewa.h). Included by kernels.inl, once per instruction set, after
// disc_batch.inl.
//
// Of a tile first the fronts: each pixel's nearest disc, moved back by what its surface may be rough; then the sums of
// all that lies before that. A disc weighs nothing from kernelSupport sigmas on, but is opaque up to kOpaqueSigmas.
// What lies behind the fronts of all blocks of pixels that it reaches is left out of the sums.

/// What lies in front at each pixel of a tile, and what is in front of that.
struct TileFilter {
    static constexpr uint32_t kOther = TileFront::kOther;
    TileGrid grid;
    alignas(64) float front[kTilePixels];     ///< depth of the front disc moved back; kNoDisc: none
    alignas(64) uint32_t id[kTilePixels];     ///< the front disc, or kOther
    alignas(64) float own[kTilePixels];       ///< depth of the front disc
    alignas(64) float farthest[kTilePixels];  ///< of what is opaque there; 0: nothing
    alignas(64) float along[kTilePixels];     ///< depth per length along the ray
    alignas(64) float limit[kTilePixels];     ///< imageLinear of `front`
    alignas(64) float nearest[kTilePixels];   ///< likewise: what is before that is another surface
    alignas(64) float rims[kTilePixels];      ///< weights of those
    alignas(64) float beyond[kTilePixels];    ///< of a second front: depth behind which it lies
    float blockBeyond[kTilePixels / kGroup];  ///< the least of it, of blocks of 4 x 4 pixels
    alignas(64) float bound[kTilePixels];     ///< of rims before other kinds: depth before which they lie, or kNoDisc
    alignas(64) uint32_t rim[kTilePixels];    ///< the first disc that counts there, or kOther; only if there are gaps
    alignas(64) float weight[kTilePixels], linear[kTilePixels];  ///< sums; linear: imageLinear of depths
    alignas(64) float red[kTilePixels], green[kTilePixels], blue[kTilePixels];
    alignas(64) float nx[kTilePixels], ny[kTilePixels], nz[kTilePixels];                  ///< only if wanted
    alignas(64) float share[kTilePixels], metallic[kTilePixels], roughness[kTilePixels];  ///< likewise
    bool hasGaps;                                                                         ///< pixels without a front
};

/// What of a pixel is wanted beside its colour and depth.
enum class Wants { nothing, normals, materials };  // materials: normals, too

/// What is added up of a tile: what is before its fronts, with or without gaps between them, or its second surfaces.
/// Of bound ones only what is before TileFilter::bound by more than its surface is rough, or of its border.
enum class Sum { closed, gaps, second, secondBound };
constexpr bool isOfSecond(Sum sum) { return sum == Sum::second || sum == Sum::secondBound; }

/// Some discs of a tile, with their kernels; those of DiscBatch that reach before the fronts.
struct FilterBatch {
    static constexpr size_t kSize = DiscBatch::kSize;
    size_t count;
    alignas(64) uint32_t of[kSize];  ///< into DiscBatch
    alignas(64) float x[kSize], y[kSize], alongX[kSize], skew[kSize], alongY[kSize], amplitude[kSize], linear[kSize],
        least[kSize], most[kSize], isNear[kSize], rough[kSize];
    alignas(64) int firstX[kSize], lastX[kSize], firstY[kSize], lastY[kSize];
    alignas(64) float red[kSize], green[kSize], blue[kSize], nx[kSize], ny[kSize], nz[kSize];
    alignas(64) float share[kSize], metallic[kSize], roughness[kSize];
    alignas(64) uint32_t colour[kSize];
    alignas(64) uint32_t seen[kSize];  ///< the blocks where it is not hidden, a bit each
};

/// Of two values that are linear on the image.
[[gnu::always_inline]] inline bool isNearer(float a, float b) { return kOrthographic ? a < b : a > b; }
constexpr float kFarthest = kOrthographic ? 3.0e38f : 0.0f, kNearest = kOrthographic ? -3.0e38f : 3.0e38f;

/// Of blocks of 4 x 4 pixels the least of the limits: what is farther is hidden there. Of second surfaces also where
/// they begin: what is wholly nearer is none of them.
struct TileBlocks {
    static constexpr int kEdge = 4, kColumns = int(SplatTile::kWidth) / kEdge, kRows = int(SplatTile::kHeight) / kEdge;
    alignas(64) float limit[kColumns * kRows];
    alignas(64) float begin[kColumns * kRows];  ///< only of second surfaces
};

[[gnu::always_inline]] inline const PointRecord& recordOf(const BlockSource* blocks, uint32_t id) {
    return blocks[id / kBlockLanes].records[id % kBlockLanes];
}

/// Packed (packColour), as resolveRow has it. `colour`: the record's.
[[gnu::always_inline]] inline uint32_t colourOf(const FrameConstants& f, const Tables& tables,
                                                const BlockSource* blocks, uint32_t id, uint32_t colour) {
    if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
        const DrawNode& node = *blocks[id / kBlockLanes].node;
        const vec3 d = f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
        return packColour(d.x, d.y, d.z);
    }
    return tables.red[colour & 255u] | tables.green[colour >> 8 & 255u] | tables.blue[colour >> 16 & 255u];
}
/// How far behind a disc its surface may be, world units. `colour`: its record's.
[[gnu::always_inline]] inline float roughness(float radius, uint32_t colour) {
    return radius * ((colour >> 24 & kFlagLeaf) != 0u ? kLeafShare : kSurfaceShare);
}

/// The blocks of 4 x 4 pixels that a box reaches, a bit each: those of its columns, in each of its rows. Of an empty
/// box, none.
[[gnu::always_inline]] inline uint32_t blocksOf(int firstX, int lastX, int firstY, int lastY) {
    static_assert(TileBlocks::kColumns == 8 && TileBlocks::kRows == 4 && TileBlocks::kEdge == 4);
    const uint32_t left = uint32_t(firstX) >> 2, right = uint32_t(lastX + 4) >> 2, top = uint32_t(firstY) >> 2,
                   bottom = uint32_t(lastY + 4) >> 2;
    const uint32_t columns = (1u << right) - (1u << left);
    const uint32_t ofRow = (top <= 0u && bottom > 0u ? 0xffu : 0u) | (top <= 1u && bottom > 1u ? 0xff00u : 0u) |
                           (top <= 2u && bottom > 2u ? 0xff0000u : 0u) | (top <= 3u && bottom > 3u ? 0xff000000u : 0u);
    return right > left ? (columns & 0xffu) * 0x01010101u & ofRow : 0u;
}

#include "engine/cpu/ewa_fronts.inl"

/// Which discs reach a block whose fronts do not hide them.
template <Sum sum>
void markSeen(const TileBlocks& blocks, size_t count, FilterBatch& __restrict b) {
    float limit[TileBlocks::kColumns * TileBlocks::kRows], begin[TileBlocks::kColumns * TileBlocks::kRows];
    for (int k = 0; k < TileBlocks::kColumns * TileBlocks::kRows; ++k) {
        limit[k] = blocks.limit[k];
        begin[k] = isOfSecond(sum) ? blocks.begin[k] : kNearest;
    }
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const uint32_t reached = blocksOf(b.firstX[i], b.lastX[i], b.firstY[i], b.lastY[i]);
        const float nearest = kOrthographic ? b.least[i] : b.most[i];  // that its plane counts as
        const float farthest = kOrthographic ? b.most[i] : b.least[i];
        uint32_t seen = 0u;
#pragma GCC unroll 32
        for (int k = 0; k < TileBlocks::kColumns * TileBlocks::kRows; ++k)
            seen |= isNearer(limit[k], nearest) || (isOfSecond(sum) && isNearer(farthest, begin[k]))
                        ? 0u
                        : reached & 1u << k;
        b.seen[i] = seen;
    }
}

void prepareKernels(const FrameConstants& frame, const SplatTile& tile, size_t count, const DiscBatch& s,
                    FilterBatch& __restrict b) {
    const FrameConstants f = frame;
    const float support = f.kernelSupport, lowPass = f.lowPass;
    const Lens lens = lensHere(f.focal);
    const int lastX = int(tile.width) - 1, lastY = int(tile.height) - 1;
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const WideDisc d = s.disc(i);
        const float sigma = d.radius * (1.0f / kOpaqueSigmas);
        const EwaKernel k = ewaKernel(d, sigma, support, lowPass, lens);
        const DepthRange range = depthRange(d, sigma, support, lowPass, lens);
        const bool isNear = k.isNear > 0.5f;  // (a kernel is not cut off at the near plane, as its disc is)
        const bool atAxis = !kOrthographic & isNear;
        b.isNear[i] = isNear ? 1.0f : 0.0f;
        b.x[i] = atAxis ? 0.0f : k.x;
        b.y[i] = atAxis ? 0.0f : k.y;
        b.alongX[i] = k.alongX;
        b.skew[i] = k.skew;
        b.alongY[i] = k.alongY;
        b.amplitude[i] = blendedAmplitude(d, k, f.nearPlane);
        b.linear[i] =
            atAxis ? planeAtAxis(d) : s.linear[i] + (s.slopeX[i] * (k.x - s.x[i]) + s.slopeY[i] * (k.y - s.y[i]));
        b.least[i] = kOrthographic ? range.nearest : 1.0f / range.farthest;
        b.most[i] = kOrthographic ? range.farthest : 1.0f / range.nearest;
        const TilePixels columns = tilePixels(k.x - k.halfX, k.x + k.halfX, f.centre.x, tile.x0, tile.width);
        const TilePixels rows = tilePixels(k.y - k.halfY, k.y + k.halfY, f.centre.y, tile.y0, tile.height);
        b.firstX[i] = isNear ? 0 : columns.first;
        b.lastX[i] = isNear ? lastX : columns.last;
        b.firstY[i] = isNear ? 0 : rows.first;
        b.lastY[i] = isNear ? lastY : rows.last;
        const float towards = dot(d.normal, sightTo(lens, d.centre)) > 0.0f ? -1.0f : 1.0f;
        b.nx[i] = d.normal.x * towards;
        b.ny[i] = d.normal.y * towards;
        b.nz[i] = d.normal.z * towards;
    }
}

/// By how much the surfels of a batch that are seen count.
void weighSurfels(const FrameConstants& f, const BlockSource* blocks, const DiscBatch& d, FilterBatch& b) {
    for (size_t s = 0; s < b.count; ++s) {
        const uint32_t id = d.id[b.of[s]];
        const uint8_t* const weights = blocks[id / kBlockLanes].weights;
        b.amplitude[b.of[s]] *= surfelScale(weights == nullptr ? 0u : weights[id % kBlockLanes], f.kernelSupport);
    }
}

/// The colours of those that are seen.
template <Sum sum>
void takeSeen(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const DiscBatch& d,
              const uint32_t* colours, const uint32_t* places, size_t count, FilterBatch& __restrict b) {
    b.count = 0;
    for (size_t i = 0; i < count; ++i) {
        b.of[b.count] = uint32_t(i);
        b.count += b.seen[i] != 0u ? 1u : 0u;
    }
    for (size_t s = 0; s < b.count; ++s) {
        const uint32_t id = d.id[b.of[s]], colour = colours[places[b.of[s]]];
        b.colour[s] = colourOf(f, tables, blocks, id, colour);
        if (sum == Sum::secondBound) b.rough[s] = roughSide(colour >> 24) * roughness(d.radius[b.of[s]], colour);
        if (f.hasMaterials == 0u) continue;
        const TexelSurface surface = surfaceOfPoint(blocks[id / kBlockLanes].materialOf(id % kBlockLanes));
        b.share[s] = surface.share;
        b.metallic[s] = surface.metallic;
        b.roughness[s] = surface.roughness;
    }
#pragma GCC ivdep
    for (size_t s = 0; s < b.count; ++s) {
        b.red[s] = unpackRed(b.colour[s]);
        b.green[s] = unpackGreen(b.colour[s]);
        b.blue[s] = unpackBlue(b.colour[s]);
    }
}

/// Adds the s-th that is seen to what is in front of the fronts. `isNear`: the disc is not wholly before the eye.
template <bool isNear, Wants wants, Sum sum>
void addKernel(const DiscBatch& b, const FilterBatch& k, size_t s, const FrameConstants& f, float end,
               TileFilter& __restrict t) {
    const size_t i = k.of[s];
    const uint32_t id = b.id[i];
    DiscForm d = formOf(b, i, f);
    d.over2 *= kOpaqueSigmas * kOpaqueSigmas;
    d.alongX = k.alongX[i];
    d.skew = k.skew[i];
    d.alongY = k.alongY[i];
    d.linear = k.linear[i];
    const float midX = k.x[i], midY = k.y[i], least = k.least[i], most = k.most[i];
    const float support2 = f.kernelSupport * f.kernelSupport, scale = k.amplitude[i] / (1.0f - end);
    const float red = k.red[s], green = k.green[s], blue = k.blue[s], nx = k.nx[i], ny = k.ny[i], nz = k.nz[i];
    constexpr bool hasMaterials = wants == Wants::materials;
    const float share = hasMaterials ? k.share[s] : 0.0f, metallic = hasMaterials ? k.metallic[s] : 0.0f,
                roughness = hasMaterials ? k.roughness[s] : 0.0f;
    const float rough = sum == Sum::secondBound ? k.rough[s] : 0.0f;
    const uint32_t seen = k.seen[i];
    const int x1 = k.lastX[i], x0 = k.firstX[i] & ~(kGroupColumns - 1);
    for (int band = k.firstY[i] >> kRowBits; band <= k.lastY[i] >> kRowBits; ++band) {
        const float dy = float(kGroupRows * band) + t.grid.top - midY;
        for (int x = x0; x <= x1; x += kGroupColumns) {
            const int first = band * kBandPitch + kGroupRows * x;
            if (isOfSecond(sum) && (seen >> (first / kGroup) & 1u) == 0u) continue;
            const float *const px = t.grid.x + kGroupRows * x, *const limit = t.limit + first,
                               *const nearest = t.nearest + first, *const bound = t.bound + first,
                               *const along = t.along + first;
            float* const rims = t.rims + first;
            float *const sumW = t.weight + first, *const sumLinear = t.linear + first, *const sumR = t.red + first,
                         *const sumG = t.green + first, *const sumB = t.blue + first, *const sumX = t.nx + first,
                         *const sumY = t.ny + first, *const sumZ = t.nz + first, *const sumShare = t.share + first,
                         *const sumMetallic = t.metallic + first, *const sumRoughness = t.roughness + first;
            uint32_t* const rim = t.rim + first;
#pragma GCC ivdep
            for (int l = 0; l < kGroup; ++l) {
                const DiscAt at = discAt<isNear>(d, px[l] - midX, dy + t.grid.row[l]);
                // No farther than it counts; beyond its horizon a plane is as far as it gets.
                const float linear = min(max(at.linear, least), most);
                bool isThere = (at.rho2 < support2) & !isNearer(limit[l], linear);
                if (sum == Sum::secondBound)
                    isThere = isThere & ((kOrthographic ? linear : 1.0f / linear) + rough * along[l] < bound[l]);
                const float any = isThere ? max(gaussian(at.rho2) - end, 0.0f) * scale : 0.0f;
                const float ofRim = isNearer(linear, nearest[l]) ? any : 0.0f, w = any - ofRim;
                if (!isOfSecond(sum)) rims[l] += ofRim;
                sumW[l] += w;
                sumLinear[l] += w * linear;
                sumR[l] += w * red;
                sumG[l] += w * green;
                sumB[l] += w * blue;
                if (wants != Wants::nothing) {
                    sumX[l] += w * nx;
                    sumY[l] += w * ny;
                    sumZ[l] += w * nz;
                }
                if (hasMaterials) {
                    sumShare[l] += w * share;
                    sumMetallic[l] += w * metallic;
                    sumRoughness[l] += w * roughness;
                }
                if (sum != Sum::closed) {
                    const uint32_t mine = w > 0.0f ? id : TileFilter::kOther;
                    rim[l] = mine < rim[l] ? mine : rim[l];
                }
            }
        }
    }
}

void beginFilter(const FrameConstants& f, const SplatTile& tile, TileFilter& __restrict t) {
    t.grid = tileGrid(f, tile);
    const float inverseFocal = 1.0f / f.focal;
    for (int band = 0; band < kBands; ++band)
        for (int i = 0; i < kBandPitch; ++i) {
            const float ex = t.grid.x[i] * inverseFocal,
                        ey = (float(kGroupRows * band + i % kGroupRows) + t.grid.top) * inverseFocal;
            t.along[band * kBandPitch + i] = kOrthographic ? 1.0f : 1.0f / std::sqrt(ex * ex + ey * ey + 1.0f);
        }
    for (size_t i = 0; i < kTilePixels; ++i) {
        t.front[i] = t.own[i] = kNoDisc;
        t.id[i] = t.rim[i] = TileFilter::kOther;
        t.farthest[i] = 0.0f;
        t.nearest[i] = kNearest;
        t.beyond[i] = t.bound[i] = kNoDisc;
        t.rims[i] = 0.0f;
        t.weight[i] = t.linear[i] = t.red[i] = t.green[i] = t.blue[i] = t.nx[i] = t.ny[i] = t.nz[i] = 0.0f;
        t.share[i] = t.metallic[i] = t.roughness[i] = 0.0f;
    }
}

#include "engine/cpu/ewa_show.inl"

/// The discs of a tile, in batches. Those of the first batches are kept from the fronts to the sums, in a cache's
/// second level (154 KB); further ones are prepared twice.
struct TileDiscs {
    static constexpr size_t kKept = 24;
    const PlacedSplat* splats;
    const uint32_t *colours, *places;
    size_t count;
    DiscBatch* batches;  ///< kKept, and one more
    size_t batchesInAll() const { return (count + DiscBatch::kSize - 1) / DiscBatch::kSize; }
    size_t sizeOf(size_t b) const {
        const size_t left = count - b * DiscBatch::kSize;
        return left < DiscBatch::kSize ? left : DiscBatch::kSize;
    }
    DiscBatch& batch(size_t b) const { return batches[b < kKept ? b : kKept]; }
};

/// True if some of the discs are leaves.
bool drawFronts(const FrameConstants& f, const TileDiscs& discs, const SplatTile& tile, TileFilter& t) {
    uint32_t flags = 0;
    for (size_t k = 0; k < discs.batchesInAll(); ++k) {
        const size_t first = k * DiscBatch::kSize, n = discs.sizeOf(k), next = first + n;
        DiscBatch& batch = discs.batch(k);
        prefetchDiscs(discs.splats, discs.places + next, discs.count - next);
        for (size_t i = 0; i < n; ++i) __builtin_prefetch(&discs.colours[discs.places[first + i]]);
        prepareDiscs(f, discs.splats, discs.places + first, n, tile, batch);
        for (size_t i = 0; i < n; ++i) {
            const uint32_t colour = discs.colours[discs.places[first + i]];
            flags |= colour >> 24;
            const float shift = roughness(batch.radius[i], colour);
            if (batch.isNear[i] > 0.5f)
                drawFront<true, false>(batch, i, shift, f, t);
            else
                drawFront<false, false>(batch, i, shift, f, t);
        }
    }
    return (flags & kFlagLeaf) != 0u;
}

/// The fronts behind TileFilter::beyond, after those before it.
void drawSecondFronts(const FrameConstants& f, const TileDiscs& discs, const SplatTile& tile, TileFilter& t) {
    alignas(64) uint32_t reached[DiscBatch::kSize];
    for (size_t k = 0; k < discs.batchesInAll(); ++k) {
        const size_t first = k * DiscBatch::kSize, n = discs.sizeOf(k);
        DiscBatch& batch = discs.batch(k);
        if (k >= TileDiscs::kKept) prepareDiscs(f, discs.splats, discs.places + first, n, tile, batch);
        markBehind(t, n, batch, reached);
        for (size_t i = 0; i < n; ++i) {
            if (reached[i] == 0u) continue;
            const float shift = roughness(batch.radius[i], discs.colours[discs.places[first + i]]);
            if (batch.isNear[i] > 0.5f)
                drawFront<true, true>(batch, i, shift, f, t, reached[i]);
            else
                drawFront<false, true>(batch, i, shift, f, t, reached[i]);
        }
    }
}

template <Wants wants, Sum sum>
void addKernels(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const TileDiscs& discs,
                const SplatTile& tile, const TileBlocks& fronts, TileFilter& t) {
    FilterBatch kernels;
    const float end = kernelEnd(f.kernelSupport);
    for (size_t k = 0; k < discs.batchesInAll(); ++k) {
        const size_t n = discs.sizeOf(k);
        const uint32_t* const places = discs.places + k * DiscBatch::kSize;
        DiscBatch& batch = discs.batch(k);
        if (k >= TileDiscs::kKept) prepareDiscs(f, discs.splats, places, n, tile, batch);
        prepareKernels(f, tile, n, batch, kernels);
        markSeen<sum>(fronts, n, kernels);
        takeSeen<sum>(f, tables, blocks, batch, discs.colours, places, n, kernels);
        if (f.perSurfel != 0u) weighSurfels(f, blocks, batch, kernels);
        for (size_t s = 0; s < kernels.count; ++s) {
            if (kernels.isNear[kernels.of[s]] > 0.5f)
                addKernel<true, wants, sum>(batch, kernels, s, f, end, t);
            else
                addKernel<false, wants, sum>(batch, kernels, s, f, end, t);
        }
    }
}

#include "engine/cpu/ewa_second.inl"

/// The discs of a tile to what its pixels show.
template <Wants wants>
void filterDiscs(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const TileDiscs& discs,
                 const SplatTile& tile, const Visibility& visibility, FilteredPixel* filtered,
                 const SecondPixels& seconds) {
    TileFilter t;
    beginFilter(f, tile, t);
    const bool hasLeaves = drawFronts(f, discs, tile, t);
    TileBlocks fronts;
    closeFronts(tile, lensHere(f.focal), t, fronts);
    if (hasLeaves) closeLeaves(blocks, t);
    if (t.hasGaps)
        addKernels<wants, Sum::gaps>(f, tables, blocks, discs, tile, fronts, t);
    else
        addKernels<wants, Sum::closed>(f, tables, blocks, discs, tile, fronts, t);
    TileOthers others;
    showTile<wants>(f, tables, blocks, tile, hasLeaves, t, visibility, filtered, others);
    if (seconds.pixels != nullptr)
        showSeconds<wants>(f, tables, blocks, discs, tile, t, others, visibility, filtered, seconds);
}

void filterTile(const FrameConstants& frame, const Tables& tables, const BlockSource* blocks, const PlacedSplat* splats,
                const uint32_t* colours, const uint32_t* places, size_t count, const SplatTile& tile, bool wantsNormals,
                const Visibility& visibility, FilteredPixel* filtered, const SecondPixels& seconds) {
    const FrameConstants f = frame;
    static thread_local DiscBatch batches[TileDiscs::kKept + 1];
    const TileDiscs discs{splats, colours, places, count, batches};
    prefetchDiscs(splats, places, count);
    const auto filter = !wantsNormals         ? filterDiscs<Wants::nothing>
                        : f.hasMaterials == 0 ? filterDiscs<Wants::normals>
                                              : filterDiscs<Wants::materials>;
    filter(f, tables, blocks, discs, tile, visibility, filtered, seconds);
    for (size_t y = 0; y < tile.height; ++y) {
        const size_t first = (tile.y0 + y) * f.width + tile.x0;
        for (size_t r = first >> Visibility::kRunBits; r <= (first + tile.width - 1) >> Visibility::kRunBits; ++r)
            __atomic_store_n(&visibility.runs[r], uint8_t{1}, __ATOMIC_RELAXED);
    }
}
