// Discs blended by their kernels (shaders/shared/ewa.h). Included by kernels.inl, once per instruction set, after
// disc_batch.inl.
//
// Of a tile first the fronts: each pixel's nearest disc, moved back by what its surface may be rough; then the sums of
// all that lies before that. A disc weighs nothing from kernelSupport sigmas on, but is opaque up to kOpaqueSigmas.
// What lies behind the fronts of all of a block of pixels is left out of its sums.

/// What lies in front at each pixel of a tile, and what is in front of that.
struct TileFilter {
    static constexpr uint32_t kOther = TileFront::kOther;
    TileGrid grid;
    alignas(64) float front[kTilePixels];      ///< depth of the front disc moved back; kNoDisc: none
    alignas(64) uint32_t id[kTilePixels];      ///< the front disc, by its place in TileDiscs, or kOther
    alignas(64) float own[kTilePixels];        ///< depth of the front disc
    alignas(64) uint32_t missed[kTilePixels];  ///< the last front disc that the pixel's ray misses, or kOther
    alignas(64) float place[kTilePixels];      ///< depth at which that is shown
    alignas(64) uint32_t isLeaf[kTilePixels];  ///< 1: the front disc is one; only of fronts that are closed
    alignas(64) float farthest[kTilePixels];   ///< of what is opaque there; 0: nothing
    alignas(64) float along[kTilePixels];      ///< depth per length along the ray
    alignas(64) float limit[kTilePixels];      ///< imageLinear of `front`
    alignas(64) float nearest[kTilePixels];    ///< likewise: what is before that is another surface
    alignas(64) float rims[kTilePixels];       ///< weights of those
    alignas(64) float beyond[kTilePixels];     ///< of a second front: depth behind which it lies
    alignas(64) float bound[kTilePixels];      ///< of rims before other kinds: depth before which they lie, or kNoDisc
    alignas(64) uint32_t rim[kTilePixels];     ///< the first disc that counts there, or kOther; only if there are gaps
    alignas(64) float weight[kTilePixels], linear[kTilePixels];  ///< sums; linear: imageLinear of depths
    alignas(64) float red[kTilePixels], green[kTilePixels], blue[kTilePixels];
    alignas(64) float nx[kTilePixels], ny[kTilePixels], nz[kTilePixels];                  ///< only if wanted
    alignas(64) float share[kTilePixels], metallic[kTilePixels], roughness[kTilePixels];  ///< likewise
    uint32_t gaps;  ///< blocks that hold pixels without a front, a bit each
};

/// What of a pixel is wanted beside its colour and depth.
enum class Wants { nothing, normals, materials };  // materials: normals, too

/// What is added up of a tile: what is before its fronts, or its second surfaces. Of bound ones only what is before
/// TileFilter::bound by more than its surface is rough, or of its border.
enum class Sum { first, second, secondBound };
constexpr bool isOfSecond(Sum sum) { return sum == Sum::second || sum == Sum::secondBound; }

/// What fronts of the discs of a DiscBatch need beside them.
struct FrontBatch {
    static constexpr size_t kSize = DiscBatch::kSize;
    alignas(64) float shift[kSize];                     ///< how far behind the disc its surface may be
    alignas(64) float missedDepth[kSize];               ///< at DiscBatch::missed
    alignas(64) float missedPlace[kSize];               ///< what is shown there
    alignas(64) float nearest[kSize], farthest[kSize];  ///< between which their planes count
    alignas(64) uint32_t colour[kSize];                 ///< and flags, of the record
};

/// The kernels of the discs of a DiscBatch.
struct KernelBatch {
    static constexpr size_t kSize = DiscBatch::kSize;
    alignas(64) float x[kSize], y[kSize], alongX[kSize], skew[kSize], alongY[kSize], amplitude[kSize], linear[kSize],
        least[kSize], most[kSize], isNear[kSize];
    alignas(64) float nx[kSize], ny[kSize], nz[kSize];  ///< towards the eye
    alignas(64) uint32_t reached[kSize];                ///< blocks, as DiscBatch::reached
    bool hasNear;                                       ///< some are not wholly before the eye
};

/// Of two values that are linear on the image.
[[gnu::always_inline]] inline bool isNearer(float a, float b) { return kOrthographic ? a < b : a > b; }
constexpr float kFarthest = kOrthographic ? 3.0e38f : 0.0f, kNearest = kOrthographic ? -3.0e38f : 3.0e38f;

/// Of the blocks of a tile the farthest of their limits: what is farther is hidden there. Of second surfaces behind
/// fronts also where they begin: what is wholly nearer is none of them, unless there are some before fronts, too.
struct BlockLimits {
    alignas(64) float limit[kTileBlocks];
    alignas(64) float begin[kTileBlocks];   ///< only of second surfaces
    alignas(64) float before[kTileBlocks];  ///< likewise: the farthest limit of those before fronts
    uint32_t used;                          ///< blocks in which something is added up, a bit each
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

/// The discs of a tile, in batches. Those of the first batches are kept from the fronts to the sums, and their kernels
/// from these to second surfaces, in a cache's second level (260 KB); further ones are prepared again.
struct TileDiscs {
    static constexpr size_t kKept = 24;
    const PlacedSplat* splats;
    const uint32_t *colours, *places;
    size_t count;
    DiscBatch* batches;  ///< kKept, and one more
    FrontBatch* fronts;
    KernelBatch* kernels;
    bool hasLeaves;  ///< some are; known once their fronts are drawn
    size_t batchesInAll() const { return (count + DiscBatch::kSize - 1) / DiscBatch::kSize; }
    size_t sizeOf(size_t b) const {
        const size_t left = count - b * DiscBatch::kSize;
        return left < DiscBatch::kSize ? left : DiscBatch::kSize;
    }
    /// Of the visibility buffer, by places among these discs. (Lists are in the order of ids: so are places.)
    uint32_t idOf(uint32_t place) const {
        const size_t batch = place / DiscBatch::kSize;
        return batch < kKept ? batches[batch].id[place % DiscBatch::kSize] : splats[places[place]].id;
    }
    WideDisc disc(uint32_t place) const {
        const size_t batch = place / DiscBatch::kSize;
        if (batch < kKept) return batches[batch].disc(place % DiscBatch::kSize);
        const PlacedSplat& s = splats[places[place]];
        return {vec3(s.cx, s.cy, s.cz), vec3(s.nx, s.ny, s.nz), s.radius, 0u};
    }
    bool isLeaf(uint32_t place) const {
        const size_t batch = place / DiscBatch::kSize;
        const uint32_t colour = batch < kKept ? fronts[batch].colour[place % DiscBatch::kSize] : colours[places[place]];
        return (colour >> 24 & kFlagLeaf) != 0u;
    }
};

/// Where a thread's lie, once it has had a tile: were they thread-local themselves, every thread would have them from
/// the start, six times (each instruction set and kind of view), in processes that only build, too.
class DiscRoom {
  public:
    struct Batches {
        DiscBatch discs[TileDiscs::kKept + 1];
        FrontBatch fronts[TileDiscs::kKept + 1];
        KernelBatch kernels[TileDiscs::kKept + 1];
    };
    DiscRoom() : batches_(new Batches{}) {}
    ~DiscRoom() { delete batches_; }
    DiscRoom(const DiscRoom&) = delete;
    DiscRoom& operator=(const DiscRoom&) = delete;
    Batches& batches() const { return *batches_; }

  private:
    Batches* const batches_;
};

/// A batch of them, from the `first` on.
struct KeptBatch {
    const DiscBatch& discs;
    const FrontBatch& fronts;
    uint32_t first;
};

#include "engine/cpu/ewa_kernels.inl"

#include "engine/cpu/ewa_fronts.inl"

#include "engine/cpu/ewa_sums.inl"

/// Nothing is there, nor added up.
void clearBlock(int block, TileFilter& __restrict t) {
    for (int i = block * kGroup; i < (block + 1) * kGroup; ++i) {
        t.front[i] = t.own[i] = kNoDisc;
        t.id[i] = t.rim[i] = t.missed[i] = TileFilter::kOther;
        t.place[i] = kNoDisc;
        t.isLeaf[i] = 0u;
        t.farthest[i] = 0.0f;
        t.limit[i] = t.nearest[i] = kNearest;
        t.beyond[i] = t.bound[i] = kNoDisc;
        t.rims[i] = 0.0f;
        t.weight[i] = t.linear[i] = t.red[i] = t.green[i] = t.blue[i] = t.nx[i] = t.ny[i] = t.nz[i] = 0.0f;
        t.share[i] = t.metallic[i] = t.roughness[i] = 0.0f;
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
    for (int block = 0; block < kTileBlocks; ++block) clearBlock(block, t);
}

#include "engine/cpu/ewa_show.inl"

KeptBatch prepareBatch(const FrameConstants& f, const TileDiscs& discs, const SplatTile& tile, size_t b) {
    const size_t first = b * DiscBatch::kSize, n = discs.sizeOf(b), to = b < TileDiscs::kKept ? b : TileDiscs::kKept;
    DiscBatch& batch = discs.batches[to];
    FrontBatch& fronts = discs.fronts[to];
    for (size_t i = 0; i < n; ++i) __builtin_prefetch(&discs.colours[discs.places[first + i]]);
    prepareDiscs(f, discs.splats, discs.places + first, n, tile, 3.0e38f, batch);
    for (size_t i = 0; i < n; ++i) fronts.colour[i] = discs.colours[discs.places[first + i]];
    prepareFronts(f, n, batch, fronts);
    return {batch, fronts, uint32_t(first)};
}
/// What was prepared before.
KeptBatch keptBatch(const FrameConstants& f, const TileDiscs& discs, const SplatTile& tile, size_t b) {
    if (b >= TileDiscs::kKept) return prepareBatch(f, discs, tile, b);
    return {discs.batches[b], discs.fronts[b], uint32_t(b * DiscBatch::kSize)};
}

void drawFronts(const FrameConstants& f, TileDiscs& discs, const SplatTile& tile, TileFilter& t) {
    uint32_t flags = 0;
    for (size_t k = 0; k < discs.batchesInAll(); ++k) {
        const size_t n = discs.sizeOf(k), next = k * DiscBatch::kSize + n;
        prefetchDiscs(discs.splats, discs.places + next, discs.count - next);
        const KeptBatch b = prepareBatch(f, discs, tile, k);
        for (size_t i = 0; i < n; ++i) flags |= b.fronts.colour[i];
        if (b.discs.hasNear)
            drawFrontBatch<true, false>(b, b.discs.reached, f, t);
        else
            drawFrontBatch<false, false>(b, b.discs.reached, f, t);
        showMissed(b, n, t);
    }
    discs.hasLeaves = (flags >> 24 & kFlagLeaf) != 0u;
}

/// The fronts behind TileFilter::beyond, after those before it. `beyond`: the least of it, of each block.
void drawSecondFronts(const FrameConstants& f, const TileDiscs& discs, const SplatTile& tile, const float* beyond,
                      TileFilter& t) {
    alignas(64) uint32_t reached[DiscBatch::kSize];
    for (size_t k = 0; k < discs.batchesInAll(); ++k) {
        const KeptBatch b = keptBatch(f, discs, tile, k);
        if (!markBehind(beyond, b.discs, reached)) continue;
        if (b.discs.hasNear)
            drawFrontBatch<true, true>(b, reached, f, t);
        else
            drawFrontBatch<false, true>(b, reached, f, t);
    }
}

template <Wants wants, Sum sum>
void addKernels(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const TileDiscs& discs,
                const SplatTile& tile, const BlockLimits& limits, TileFilter& t) {
    SeenKernels seen;
    for (size_t k = 0; k < discs.batchesInAll(); ++k) {
        const KeptBatch b = keptBatch(f, discs, tile, k);
        KernelBatch& kernels = discs.kernels[k < TileDiscs::kKept ? k : TileDiscs::kKept];
        if (!isOfSecond(sum) || k >= TileDiscs::kKept) prepareKernels(f, tile, discs.sizeOf(k), b, kernels);
        if (!markSeen<sum>(limits, kernels, seen)) continue;
        takeSeen<sum>(f, tables, blocks, b.discs, kernels, b.fronts, seen);
        if (kernels.hasNear)
            addBatch<true, wants, sum>(b, kernels, seen, f, t);
        else
            addBatch<false, wants, sum>(b, kernels, seen, f, t);
    }
}

#include "engine/cpu/ewa_second.inl"

/// The discs of a tile to what its pixels show.
template <Wants wants>
void filterDiscs(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, TileDiscs& discs,
                 const SplatTile& tile, const Visibility& visibility, FilteredPixel* filtered,
                 const SecondPixels& seconds) {
    TileFilter t;
    beginFilter(f, tile, t);
    drawFronts(f, discs, tile, t);
    BlockLimits limits;
    closeFronts(discs, lensHere(f.focal), t, limits);
    addKernels<wants, Sum::first>(f, tables, blocks, discs, tile, limits, t);
    TileOthers others;
    showTile<wants>(f, tables, blocks, discs, tile, t, visibility, filtered, others);
    if (seconds.list != nullptr)
        showSeconds<wants>(f, tables, blocks, discs, tile, t, others, visibility, filtered, seconds);
}

void filterTile(const FrameConstants& frame, const Tables& tables, const BlockSource* blocks, const PlacedSplat* splats,
                const uint32_t* colours, const uint32_t* places, size_t count, const SplatTile& tile, bool wantsNormals,
                const Visibility& visibility, FilteredPixel* filtered, const SecondPixels& seconds) {
    const FrameConstants f = frame;
    static thread_local const DiscRoom room;
    DiscRoom::Batches& batches = room.batches();
    TileDiscs discs{splats, colours, places, count, batches.discs, batches.fronts, batches.kernels, false};
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
