// Texture sampling of the cpu backend: trilinear, from the finest tiles that are there. Included by kernels.inl.

/// Texture coordinates of a row's pixels, and how many of them a pixel covers.
struct UvRow {
    alignas(64) float u[kTile], v[kTile], footprint[kTile];
};
/// What a texture has there; only where isThere.
struct SampledRow {
    alignas(64) float r[kTile], g[kTile], b[kTile];
    alignas(64) uint32_t isThere[kTile];
};
/// A texture coordinate that is a number: texels are indexed by it. (Comparisons with NaN are false.)
[[gnu::always_inline]] inline float placed(float u) { return std::fabs(u) < 1.0e30f ? u : 0.0f; }
/// Bilinear taps of one level and their four texels.
struct TapRow {
    alignas(64) uint32_t tile[kTile], at[kTile];
    alignas(64) float fx[kTile], fy[kTile];
    alignas(64) uint32_t texel[4][kTile];
};

[[gnu::always_inline]] inline void findTaps(const TextureInfo& info, const uint32_t* __restrict level,
                                            const float* __restrict u, const float* __restrict v, size_t n,
                                            TapRow& __restrict taps) {
    uint32_t firstTile[kTextureLevels];
    for (size_t l = 0; l < kTextureLevels; ++l) firstTile[l] = info.firstTile[l];
    TextureInfo t{};
    t.width = info.width;
    t.height = info.height;
    t.wrapU = info.wrapU;
    t.wrapV = info.wrapV;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const TextureTap tap = textureTap(t, firstTile[level[i]], level[i], u[i], v[i]);
        taps.tile[i] = tap.tile;
        taps.at[i] = tap.y * kTileEdge + tap.x;
        taps.fx[i] = tap.fx;
        taps.fy[i] = tap.fy;
    }
}
[[gnu::always_inline]] inline void fetch(const uint32_t* tile, size_t i, TapRow& taps) {
    const uint32_t* at = tile + taps.at[i];
    taps.texel[0][i] = at[0];
    taps.texel[1][i] = at[1];
    taps.texel[2][i] = at[kTileEdge];
    taps.texel[3][i] = at[kTileEdge + 1];
}
/// One channel, `shift` bits up, between the four texels.
template <bool isColour>
[[gnu::always_inline]] inline float bilinear(const TapRow& taps, size_t i, uint32_t shift) {
    const auto value = [&](size_t k) {
        const float s = float(int(taps.texel[k][i] >> shift & 255u)) * (1.0f / 255.0f);
        return isColour ? linearFromByte(s) : s;
    };
    const float a = value(0), b = value(1), c = value(2), d = value(3);
    const float upper = a + (b - a) * taps.fx[i], lower = c + (d - c) * taps.fx[i];
    return upper + (lower - upper) * taps.fy[i];
}
template <bool isColour>
void mixLevels(const TapRow& __restrict fine, const TapRow& __restrict coarse, const float* __restrict between,
               size_t n, SampledRow& __restrict out) {
    for (uint32_t k = 0; k < 3; ++k) {
        float* __restrict const to = k == 0 ? out.r : k == 1 ? out.g : out.b;
        const uint32_t shift = 8 * k;
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const float near = bilinear<isColour>(fine, i, shift), far = bilinear<isColour>(coarse, i, shift);
            to[i] = near + (far - near) * between[i];
        }
    }
}

/// The texels of two levels about n coordinates from `first` on (at entries from 0 on), and how far between them. What
/// is not there yet is taken from the finest level that is.
void findTexels(const TextureSet& set, const TextureSlot& slot, const UvRow& uv, size_t first, size_t n, TapRow& fine,
                TapRow& coarse, float* __restrict between, uint32_t* __restrict isThere) {
    const TextureInfo& info = set.infos[slot.texture - 1];
    alignas(64) float u[kTile], v[kTile];
    alignas(64) uint32_t level[kTile], coarser[kTile];
    const uint32_t last = info.levels - 1;
    const float size = float(int(info.width > info.height ? info.width : info.height)), highest = float(int(last));
    const vec3 rowU = slot.rowU, rowV = slot.rowV;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        u[i] = placed(rowU.x * uv.u[first + i] + rowU.y * uv.v[first + i] + rowU.z);
        v[i] = placed(rowV.x * uv.u[first + i] + rowV.y * uv.v[first + i] + rowV.z);
        const float lod = min(textureLod(uv.footprint[first + i] * size), highest);
        level[i] = uint32_t(int(lod));
        between[i] = lod - float(int(level[i]));
        coarser[i] = level[i] < last ? level[i] + 1 : last;
    }
    findTaps(info, level, u, v, n, fine);
    findTaps(info, coarser, u, v, n, coarse);
    for (size_t i = 0; i < n; ++i) {
        const uint32_t* tile = set.tiles[fine.tile[i]];
        isThere[i] = 1;
        if (tile == nullptr) {  // the finest level that is there
            between[i] = 0;
            for (uint32_t l = level[i] + 1; tile == nullptr && l <= last; ++l) {
                const TextureTap tap = textureTap(info, info.firstTile[l], l, u[i], v[i]);
                tile = set.tiles[tap.tile];
                fine.at[i] = tap.y * kTileEdge + tap.x;
                fine.fx[i] = tap.fx;
                fine.fy[i] = tap.fy;
            }
        }
        if (tile == nullptr) {
            isThere[i] = 0;
            for (size_t k = 0; k < 4; ++k) fine.texel[k][i] = coarse.texel[k][i] = 0;
            continue;
        }
        fetch(tile, i, fine);
        const uint32_t* next = between[i] > 0 ? set.tiles[coarse.tile[i]] : nullptr;
        if (next == nullptr) {
            between[i] = 0;
            for (size_t k = 0; k < 4; ++k) coarse.texel[k][i] = 0;
        } else {
            fetch(next, i, coarse);
        }
    }
}

/// `slot` names a texture; n coordinates from `first` on, results from there on as well.
void sampleRow(const TextureSet& set, const TextureSlot& slot, const UvRow& uv, size_t first, size_t n,
               SampledRow& out) {
    TapRow fine, coarse;
    alignas(64) float between[kTile];
    alignas(64) uint32_t isThere[kTile];
    findTexels(set, slot, uv, first, n, fine, coarse, between, isThere);
    SampledRow compact;
    if (set.infos[slot.texture - 1].isColour != 0)
        mixLevels<true>(fine, coarse, between, n, compact);
    else
        mixLevels<false>(fine, coarse, between, n, compact);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        out.r[first + i] = compact.r[i];
        out.g[first + i] = compact.g[i];
        out.b[first + i] = compact.b[i];
        out.isThere[first + i] = isThere[i];
    }
}

/// Alphas times what a texture has at n coordinates from `first` on, where something is there yet.
void sampleAlphas(const TextureSet& set, const TextureSlot& slot, const UvRow& uv, size_t first, size_t n,
                  float* __restrict alpha) {
    TapRow fine, coarse;
    alignas(64) float between[kTile];
    alignas(64) uint32_t isThere[kTile];
    findTexels(set, slot, uv, first, n, fine, coarse, between, isThere);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float near = bilinear<false>(fine, i, 24u), far = bilinear<false>(coarse, i, 24u);
        alpha[i] *= isThere[i] != 0u ? near + (far - near) * between[i] : 1.0f;
    }
}
