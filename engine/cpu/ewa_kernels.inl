// Kernels of the discs of a tile, ready to be added up. Included by ewa.inl.

/// Where the pixel that holds a disc's centre, but whose ray misses the disc, shows it: at the depth of its plane, so
/// that the surface agrees with it. `ex`, `ey`: its ray.
[[gnu::always_inline]] inline float depthMissed(const Lens& lens, const WideDisc& d, const DepthRange& range, float ex,
                                                float ey) {
    const PixelRay ray = pixelRay(lens, ex, ey);
    return depthWithin(range, dot(d.normal, fromRay(ray, d.centre)), dot(d.normal, rayDirection(ray)));
}

void prepareKernels(const FrameConstants& frame, const SplatTile& tile, size_t count, const KeptBatch& of,
                    KernelBatch& __restrict b) {
    const FrameConstants f = frame;
    const DiscBatch& s = of.discs;
    const float support = f.kernelSupport, lowPass = f.lowPass;
    const Lens lens = lensHere(f.focal);
    const int lastX = int(tile.width) - 1, lastY = int(tile.height) - 1;
    BatchBoxes boxes;
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const WideDisc d = s.disc(i);
        const float sigma = d.radius * (1.0f / kOpaqueSigmas);
        const EwaKernel k = ewaKernel(d, sigma, support, lowPass, lens);
        const DepthRange range{of.fronts.nearest[i], of.fronts.farthest[i]};
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
        boxes.firstX[i] = isNear ? 0 : columns.first;
        boxes.lastX[i] = isNear ? lastX : columns.last;
        boxes.firstY[i] = isNear ? 0 : rows.first;
        boxes.lastY[i] = isNear ? lastY : rows.last;
        const float towards = dot(d.normal, sightTo(lens, d.centre)) > 0.0f ? -1.0f : 1.0f;
        b.nx[i] = d.normal.x * towards;
        b.ny[i] = d.normal.y * towards;
        b.nz[i] = d.normal.z * towards;
    }
    b.hasNear = hasSome(b.isNear, count);
    reachBlocks(boxes, count, b.reached);
}
/// How far behind discs their surfaces may be, between which depths their planes count, and what pixels show whose rays
/// miss them. `colour` of `b` is there.
void prepareFronts(const FrameConstants& frame, size_t count, const DiscBatch& s, FrontBatch& __restrict b) {
    const FrameConstants f = frame;
    const float inverseFocal = 1.0f / f.focal;
    const Lens lens = lensHere(f.focal);
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const WideDisc d = s.disc(i);
        b.shift[i] = roughness(d.radius, b.colour[i]);
        const DepthRange range = depthRange(d, d.radius * (1.0f / kOpaqueSigmas), f.kernelSupport, f.lowPass, lens);
        b.nearest[i] = range.nearest;
        b.farthest[i] = range.farthest;
        const float toImage = f.focal / lensDepth(lens, d.centre.z);
        const float ex = (std::floor(d.centre.x * toImage + f.centre.x) + 0.5f - f.centre.x) * inverseFocal,
                    ey = (std::floor(d.centre.y * toImage + f.centre.y) + 0.5f - f.centre.y) * inverseFocal;
        b.missedDepth[i] = depthMissed(lens, d, range, ex, ey);
        b.missedPlace[i] = placeOfMissed(d, b.missedDepth[i]);
    }
}

/// Those of a batch that are added up: where, by how much and with which attributes.
struct SeenKernels {
    static constexpr size_t kSize = DiscBatch::kSize;
    alignas(64) uint32_t blocks[kSize];  ///< where they are not hidden, a bit each
    uint64_t any;                        ///< those that are added up, a bit each
    BlockDiscs discs;
    alignas(64) uint32_t colour[kSize];
    alignas(64) float scale[kSize], rough[kSize], red[kSize], green[kSize], blue[kSize];
    alignas(64) float share[kSize], metallic[kSize], roughness[kSize];
};

/// Which discs reach a block where they are not hidden. False: none.
template <Sum sum>
bool markSeen(const BlockLimits& limits, const KernelBatch& b, SeenKernels& __restrict seen) {
    float limit[kTileBlocks], begin[kTileBlocks], before[kTileBlocks];
    for (int k = 0; k < kTileBlocks; ++k) {
        limit[k] = limits.limit[k];
        begin[k] = isOfSecond(sum) ? limits.begin[k] : kNearest;
        before[k] = isOfSecond(sum) ? limits.before[k] : kNearest;
    }
    const uint32_t used = limits.used;
    uint32_t any = 0u;
#pragma GCC ivdep
    for (size_t i = 0; i < DiscBatch::kSize; ++i) {
        const uint32_t reached = b.reached[i] & used;
        const float nearest = kOrthographic ? b.least[i] : b.most[i];  // that its plane counts as
        const float farthest = kOrthographic ? b.most[i] : b.least[i];
        uint32_t blocks = 0u;
#pragma GCC unroll 32
        for (int k = 0; k < kTileBlocks; ++k) {
            bool isHidden = isNearer(limit[k], nearest);
            if (isOfSecond(sum)) isHidden = (isHidden | isNearer(farthest, begin[k])) & isNearer(before[k], nearest);
            blocks |= isHidden ? 0u : reached & 1u << k;
        }
        seen.blocks[i] = blocks;
        any |= blocks;
    }
    if (any == 0u) return false;
    turnBits(seen.blocks, seen.discs);
    seen.any = 0u;
    for (int k = 0; k < kTileBlocks; ++k) seen.any |= seen.discs.of[k];
    return true;
}

/// Colours and weights of those that are seen.
template <Sum sum>
void takeSeen(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const DiscBatch& d,
              const KernelBatch& k, const FrontBatch& fronts, SeenKernels& __restrict seen) {
    constexpr size_t kSize = DiscBatch::kSize;
    const float over = 1.0f - kernelEnd(f.kernelSupport);
    for (size_t i = 0; i < kSize; ++i) seen.colour[i] = 0u;
    for (size_t i = 0; i < kSize; ++i) seen.scale[i] = k.amplitude[i];
    forBits(
        seen.any, [&](size_t i) __attribute__((always_inline)) {
            seen.colour[i] = colourOf(f, tables, blocks, d.id[i], fronts.colour[i]);
            if (sum == Sum::secondBound) seen.rough[i] = roughSide(fronts.colour[i] >> 24) * fronts.shift[i];
        });
    if (f.perSurfel != 0u)
        forBits(seen.any, [&](size_t i) {
            const uint8_t* const weights = blocks[d.id[i] / kBlockLanes].weights;
            seen.scale[i] *= surfelScale(weights == nullptr ? 0u : weights[d.id[i] % kBlockLanes], f.kernelSupport);
        });
    if (f.hasMaterials != 0u)
        forBits(seen.any, [&](size_t i) {
            const uint32_t material = blocks[d.id[i] / kBlockLanes].materialOf(d.id[i] % kBlockLanes);
            const TexelSurface surface = surfaceOfPoint(material);
            seen.share[i] = surface.share;
            seen.metallic[i] = surface.metallic;
            seen.roughness[i] = surface.roughness;
        });
#pragma GCC ivdep
    for (size_t i = 0; i < kSize; ++i) {
        seen.scale[i] /= over;
        seen.red[i] = unpackRed(seen.colour[i]);
        seen.green[i] = unpackGreen(seen.colour[i]);
        seen.blue[i] = unpackBlue(seen.colour[i]);
    }
}
