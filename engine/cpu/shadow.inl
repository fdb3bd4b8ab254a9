// Masks of lights that cast shadows, for the pixels of a row (shaders/shared/shadow.h). Included by kernels.inl, once
// per instruction set.

/// Pixels of a row that a light may fall on, closed up; and what is left of them for the next map.
struct alignas(64) ShadowPixels {
    uint32_t at[kTile];
    float x[kTile], y[kTile], z[kTile], nx[kTile], ny[kTile], nz[kTile], leaf[kTile], reach2[kTile];
};
/// As a map sees them.
struct alignas(64) ShadowPlaces {
    float x[kTile], y[kTile], depth[kTile], slopeX[kTile], slopeY[kTile], whole[kTile], state[kTile];
    uint32_t word[kTile];
};
constexpr float kOffMap = 0.0f, kOnMap = 1.0f;

[[gnu::always_inline]] inline size_t takeSeen(const FrameConstants& f, const SurfaceRow& row, uint32_t x0, uint32_t y,
                                              uint32_t n, ShadowPixels& p, float& nearest) {
    const Lens lens = lensHere(f.focal);
    const float inverse = 1.0f / f.focal, offX = float(int(x0)) + 0.5f - f.centre.x,
                offY = float(int(y)) + 0.5f - f.centre.y;
    size_t count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        if (!(row.depth[i] > 0.0f)) continue;
        p.at[count] = i;
        p.z[count] = row.depth[i];
        p.nx[count] = row.nx[i];
        p.ny[count] = row.ny[i];
        p.nz[count] = row.nz[i];
        p.leaf[count++] = row.leaf[i];
    }
    nearest = 3.0e38f;
    for (size_t k = 0; k < count; ++k) {
        p.x[k] = row.placeX != nullptr ? row.placeX[p.at[k]] : offX + float(int(p.at[k]));
        p.y[k] = row.placeY != nullptr ? row.placeY[p.at[k]] : offY;
    }
    for (size_t k = 0; k < count; ++k) {
        const vec3 c = alongRay(pixelRay(lens, p.x[k] * inverse, p.y[k] * inverse), p.z[k]);
        p.x[k] = c.x;
        p.y[k] = c.y;
        p.reach2[k] = c.x * c.x + c.y * c.y + c.z * c.z;
        nearest = min(nearest, p.reach2[k]);
    }
    return count;
}

template <bool isPerspective>
[[gnu::always_inline]] inline void placeOnMap(const ShadowMap& map, const ShadowPixels& pixels, size_t count,
                                              float focal, ShadowPlaces& out) {
    const ShadowMap m = map;
    const ShadowPixels& __restrict p = pixels;
    ShadowPlaces& __restrict o = out;
    const Lens lens = lensHere(focal);
#pragma GCC ivdep
    for (size_t k = 0; k < count; ++k) {
        const vec3 point = vec3(p.x[k], p.y[k], p.z[k]), normal = vec3(p.nx[k], p.ny[k], p.nz[k]);
        const ShadowPlace s = shadowPlace(m, isPerspective, point, normal, lensDepth(lens, p.z[k]));
        o.x[k] = s.x;
        o.y[k] = s.y;
        o.depth[k] = s.depth;
        o.slopeX[k] = s.slopeX;
        o.slopeY[k] = s.slopeY;
        o.whole[k] = s.whole;
        const float edge = float(int(m.edge));
        const bool isOn = (s.x >= 0.0f) & (s.x < edge) & (s.y >= 0.0f) & (s.y < edge) &
                          (!isPerspective | (s.whole > 0.0f)) & (p.reach2[k] <= m.reach2);
        o.state[k] = isOn ? kOnMap : kOffMap;
    }
}

/// Borders are hard, and no leaf is met.
[[gnu::always_inline]] inline void hardShadows(const ShadowMap& map, const float* __restrict depths, size_t count,
                                               ShadowPlaces& places) {
    const ShadowMap m = map;
    ShadowPlaces& __restrict o = places;
#pragma GCC ivdep
    for (size_t k = 0; k < count; ++k) {
        ShadowPlace s;
        s.x = o.x[k];
        s.y = o.y[k];
        s.depth = o.depth[k];
        s.slopeX = o.slopeX[k];
        s.slopeY = o.slopeY[k];
        const uint32_t share = uint32_t(int(shadowShare(depths, nullptr, m, s, s.x, s.y) * 1023.0f + 0.5f));
        o.word[k] = share | share << 10 | share << 20;
    }
}

/// `at`: of each place, its pixel of row `y` from `x0` on.
[[gnu::always_inline]] inline void softShadows(const ShadowMap& m, const float* depths, const uint32_t* through,
                                               size_t count, const uint32_t* at, uint32_t x0, uint32_t y, uint32_t seed,
                                               ShadowPlaces& o) {
    for (size_t k = 0; k < count; ++k) {
        ShadowPlace s;
        s.x = o.x[k];
        s.y = o.y[k];
        s.depth = o.depth[k];
        s.slopeX = o.slopeX[k];
        s.slopeY = o.slopeY[k];
        s.whole = o.whole[k];
        o.word[k] = packLight(lightPast(depths, through, m, s, firstGolden(x0 + at[k], y, seed)));
    }
}

/// Keeps the places of `o` that are on the map at its beginning, and pixels that are for other maps at that of `p`.
[[gnu::always_inline]] inline size_t sortOut(ShadowPixels& p, size_t& left, ShadowPlaces& o, uint32_t* __restrict at) {
    size_t on = 0, off = 0;
    for (size_t k = 0; k < left; ++k) {
        if (o.state[k] == kOnMap) {
            at[on] = p.at[k];
            o.x[on] = o.x[k];
            o.y[on] = o.y[k];
            o.depth[on] = o.depth[k];
            o.slopeX[on] = o.slopeX[k];
            o.slopeY[on] = o.slopeY[k];
            o.whole[on++] = o.whole[k];
            continue;
        }
        p.at[off] = p.at[k];
        p.x[off] = p.x[k];
        p.y[off] = p.y[k];
        p.z[off] = p.z[k];
        p.nx[off] = p.nx[k];
        p.ny[off] = p.ny[k];
        p.nz[off] = p.nz[k];
        p.leaf[off] = p.leaf[k];
        p.reach2[off++] = p.reach2[k];
    }
    left = off;
    return on;
}

/// What is turned away from a light gets none of it: it needs no mask.
[[gnu::always_inline]] inline size_t facing(const ShadowMap& m, ShadowPixels& p, size_t count) {
    size_t kept = 0;
    for (size_t k = 0; k < count; ++k) {
        const vec3 n = vec3(p.nx[k], p.ny[k], p.nz[k]);
        if (m.isPerspective == 0u && dot(m.forward, n) >= 0.0f && p.leaf[k] < 0.5f) continue;
        p.at[kept] = p.at[k];
        p.x[kept] = p.x[k];
        p.y[kept] = p.y[k];
        p.z[kept] = p.z[k];
        p.nx[kept] = n.x;
        p.ny[kept] = n.y;
        p.nz[kept] = n.z;
        p.leaf[kept] = p.leaf[k];
        p.reach2[kept++] = p.reach2[k];
    }
    return kept;
}

void shadowRow(const FrameConstants& frame, const ShadowInput& in, uint32_t x0, uint32_t y, uint32_t n,
               SurfaceRow& __restrict row) {
    const FrameConstants f = frame;
    ShadowPixels seen, p;
    ShadowPlaces o;
    uint32_t at[kTile];
    float nearest = 0;
    const size_t count = takeSeen(f, row, x0, y, n, seen, nearest);
    for (uint32_t s = 0; s < in.slots; ++s)
        for (size_t i = 0; i < n; ++i) row.shadow[s][i] = kAllLight;
    row.shadowSlots = in.slots;
    uint32_t slot = ~0u;
    size_t left = 0;
    for (uint32_t k = 0; k < in.count; ++k) {
        const ShadowMap& m = in.maps[k];
        if (m.slot != slot) {
            p = seen;
            slot = m.slot;
            left = facing(m, p, count);
        }
        if (left == 0 || m.reach2 < nearest) continue;
        if (m.isPerspective != 0u)
            placeOnMap<true>(m, p, left, f.focal, o);
        else
            placeOnMap<false>(m, p, left, f.focal, o);
        const size_t on = sortOut(p, left, o, at);
        if (m.size > 0.0f || m.hasLeaves != 0u)
            softShadows(m, in.depths[k], in.through[k], on, at, x0, y, f.coverageSeed, o);
        else
            hardShadows(m, in.depths[k], on, o);
        for (size_t i = 0; i < on; ++i) row.shadow[slot][at[i]] = o.word[i];
    }
}
