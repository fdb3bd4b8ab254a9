// Sums of the kernels at the pixels of a tile. Included by ewa.inl.

/// What is added up of a block.
struct BlockSums {
    alignas(64) float weight[kGroup], linear[kGroup], red[kGroup], green[kGroup], blue[kGroup], rims[kGroup];
    alignas(64) float nx[kGroup], ny[kGroup], nz[kGroup], share[kGroup], metallic[kGroup], roughness[kGroup];
    alignas(64) uint32_t rim[kGroup];

    template <Wants wants, Sum sum, bool hasGaps, typename Use>
    [[gnu::always_inline]] void each(TileFilter& t, int first, const Use& use) {
        use(t.weight + first, weight);
        use(t.linear + first, linear);
        use(t.red + first, red);
        use(t.green + first, green);
        use(t.blue + first, blue);
        if (sum == Sum::first) use(t.rims + first, rims);
        if (hasGaps) use(t.rim + first, rim);
        if (wants == Wants::nothing) return;
        use(t.nx + first, nx);
        use(t.ny + first, ny);
        use(t.nz + first, nz);
        if (wants != Wants::materials) return;
        use(t.share + first, share);
        use(t.metallic + first, metallic);
        use(t.roughness + first, roughness);
    }
};
/// A block: where its pixels are, and which depths are added up there. (Arrays of its own: what may lie anywhere in
/// memory GCC does not read ahead of a condition.)
struct BlockPlace {
    alignas(64) float px[kGroup], row[kGroup], limit[kGroup], nearest[kGroup], bound[kGroup], along[kGroup];
    float top;
};
template <Sum sum>
[[gnu::always_inline]] inline void placeBlock(const TileFilter& t, int block, BlockPlace& at) {
    const int first = block * kGroup;
    copyGroup(t.grid.x + block % kBlockColumns * kGroup, at.px);
    copyGroup(t.grid.row, at.row);
    at.top = float(kGroupRows * (block / kBlockColumns)) + t.grid.top;
    copyGroup(t.limit + first, at.limit);
    copyGroup(t.nearest + first, at.nearest);
    if (sum != Sum::secondBound) return;
    copyGroup(t.bound + first, at.bound);
    copyGroup(t.along + first, at.along);
}

/// Adds the i-th kernel to the sums of a block. `isNear`: the disc is not wholly before the eye; `hasGaps`:
/// what counts first is wanted, too.
template <bool isNear, Wants wants, Sum sum, bool hasGaps>
[[gnu::always_inline]] inline void addKernel(const KeptBatch& of, const KernelBatch& k, const SeenKernels& seen,
                                             size_t i, const FrameConstants& f, float end, const BlockPlace& at,
                                             BlockSums& __restrict s) {
    const DiscBatch& b = of.discs;
    const uint32_t id = of.first + uint32_t(i);
    DiscForm d = formOf(b, i, f);
    d.over2 *= kOpaqueSigmas * kOpaqueSigmas;
    d.alongX = k.alongX[i];
    d.skew = k.skew[i];
    d.alongY = k.alongY[i];
    d.linear = k.linear[i];
    const float midX = k.x[i], dy = at.top - k.y[i], least = k.least[i], most = k.most[i];
    const float support2 = f.kernelSupport * f.kernelSupport, scale = seen.scale[i];
    const float red = seen.red[i], green = seen.green[i], blue = seen.blue[i];
    const float nx = k.nx[i], ny = k.ny[i], nz = k.nz[i];
    constexpr bool hasMaterials = wants == Wants::materials;
    const float share = hasMaterials ? seen.share[i] : 0.0f, metallic = hasMaterials ? seen.metallic[i] : 0.0f,
                roughness = hasMaterials ? seen.roughness[i] : 0.0f;
    const float rough = sum == Sum::secondBound ? seen.rough[i] : 0.0f;
#pragma GCC ivdep
    for (int l = 0; l < kGroup; ++l) {
        const DiscAt hit = discAt<isNear>(d, at.px[l] - midX, dy + at.row[l]);
        // No farther than it counts; beyond its horizon a plane is as far as it gets.
        const float linear = min(max(hit.linear, least), most);
        bool isThere = (hit.rho2 < support2) & !isNearer(at.limit[l], linear);
        if (sum == Sum::secondBound)
            isThere = isThere & ((kOrthographic ? linear : 1.0f / linear) + rough * at.along[l] < at.bound[l]);
        // (A factor, not a condition: of those that hang on each other GCC makes branches, and no SIMD.)
        const float any = max(gaussian(hit.rho2) - end, 0.0f) * (isThere ? scale : 0.0f);
        const float w = any * (isNearer(linear, at.nearest[l]) ? 0.0f : 1.0f);
        if (sum == Sum::first) s.rims[l] += any - w;
        s.weight[l] += w;
        s.linear[l] += w * linear;
        s.red[l] += w * red;
        s.green[l] += w * green;
        s.blue[l] += w * blue;
        if (wants != Wants::nothing) {
            s.nx[l] += w * nx;
            s.ny[l] += w * ny;
            s.nz[l] += w * nz;
        }
        if (hasMaterials) {
            s.share[l] += w * share;
            s.metallic[l] += w * metallic;
            s.roughness[l] += w * roughness;
        }
        if (hasGaps) {
            const uint32_t mine = id | (w > 0.0f ? 0u : TileFilter::kOther);
            s.rim[l] = mine < s.rim[l] ? mine : s.rim[l];
        }
    }
}

template <bool hasNear, Wants wants, Sum sum, bool hasGaps>
void addToBlock(const KeptBatch& b, const KernelBatch& k, const SeenKernels& seen, int block, const FrameConstants& f,
                TileFilter& __restrict t) {
    const int first = block * kGroup;
    BlockPlace at;
    placeBlock<sum>(t, block, at);
    const float end = kernelEnd(f.kernelSupport);
    BlockSums s;
    s.each<wants, sum, hasGaps>(
        t, first, [](const auto* of, auto* here) __attribute__((always_inline)) { copyGroup(of, here); });
    forBits(
        seen.discs.of[block], [&](size_t i) __attribute__((always_inline)) {
            if (hasNear && k.isNear[i] > 0.5f)
                addKernel<true, wants, sum, hasGaps>(b, k, seen, i, f, end, at, s);
            else
                addKernel<false, wants, sum, hasGaps>(b, k, seen, i, f, end, at, s);
        });
    s.each<wants, sum, hasGaps>(
        t, first, [](auto* of, const auto* here) __attribute__((always_inline)) { copyGroup(here, of); });
}

/// Adds what is seen of a batch, block by block.
template <bool hasNear, Wants wants, Sum sum>
void addBatch(const KeptBatch& b, const KernelBatch& k, const SeenKernels& seen, const FrameConstants& f,
              TileFilter& t) {
    for (int block = 0; block < kTileBlocks; ++block) {
        if (seen.discs.of[block] == 0u) continue;
        if (sum != Sum::first || (t.gaps >> block & 1u) != 0u)
            addToBlock<hasNear, wants, sum, true>(b, k, seen, block, f, t);
        else
            addToBlock<hasNear, wants, sum, false>(b, k, seen, block, f, t);
    }
}
