// Masks of lights that cast shadows, for the pixels of a row (shaders/shared/shadow.h), by groups of kTexelGroup pixels
// of which some are for a map. Included by kernels.inl, once per instruction set.

/// The pixels of a row in camera space.
struct alignas(64) ShadowPixels {
    float x[kTile], y[kTile], z[kTile], reach2[kTile];
    float left[kTile];  ///< 1: for the next maps of the light, else 0
};
/// As a map sees them.
struct alignas(64) ShadowPlaces {
    float x[kTile], y[kTile], depth[kTile], slopeX[kTile], slopeY[kTile], whole[kTile];
    float isOn[kTile];  ///< 1: it is this map that says what comes to the pixel, else 0
    [[gnu::always_inline]] ShadowPlace at(size_t i) const {
        ShadowPlace s;
        s.x = x[i];
        s.y = y[i];
        s.depth = depth[i];
        s.slopeX = slopeX[i];
        s.slopeY = slopeY[i];
        s.whole = whole[i];
        return s;
    }
};
/// Of lights that have a size.
struct alignas(64) ShadowTaps {
    float firstX[kTile], firstY[kTile];  ///< firstGolden
    float x[kTile], y[kTile];            ///< the direction that is next
    float reach[kTile], sum[kTile], count[kTile];
    float radius[kTile];  ///< penumbraOf
    float isWide[kTile];  ///< 1: it has one, else 0
    float red[kTile], green[kTile], blue[kTile];
};

/// Texels that are looked up: of each pixel the first one of four or the only one, and what is there; of four those
/// side by side are read together.
struct alignas(64) ShadowReads {
    uint32_t at[kTile];
    float column[kTile], row[kTile], depth[kTile];
    float upper[2 * kTile], lower[2 * kTile];
    uint32_t throughUpper[2 * kTile], throughLower[2 * kTile];
};
/// (One after another: a processor's gathers take longer, and would read each texel by itself.)
template <typename T>
[[gnu::always_inline]] inline void readFour(const T* __restrict from, uint32_t stride, const uint32_t* __restrict at,
                                            size_t first, size_t last, T* __restrict upper, T* __restrict lower) {
    for (size_t i = first; i < last; ++i) {
        asm volatile("");  // no SIMD
        const T* const texel = from + at[i];
        __builtin_memcpy(upper + 2 * i, texel, 2 * sizeof(T));
        __builtin_memcpy(lower + 2 * i, texel + stride, 2 * sizeof(T));
    }
}
[[gnu::always_inline]] inline void readOne(const float* __restrict from, const uint32_t* __restrict at, size_t first,
                                           size_t last, float* __restrict to) {
    for (size_t i = first; i < last; ++i) {
        asm volatile("");  // no SIMD
        to[i] = from[at[i]];
    }
}

/// `groups`: with a surface.
[[gnu::always_inline]] inline void placePixels(const FrameConstants& f, const SurfaceRow& __restrict row, uint32_t x0,
                                               uint32_t y, uint32_t groups, uint32_t n, ShadowPixels& __restrict p) {
    const Lens lens = lensHere(f.focal);
    const float inverse = 1.0f / f.focal, offX = float(int(x0)) + 0.5f - f.centre.x,
                offY = float(int(y)) + 0.5f - f.centre.y;
    for (size_t i = 0; i < n; ++i) {
        p.x[i] = offX + float(int(i));
        p.y[i] = offY;
    }
    if (row.placeX != nullptr)
        for (size_t i = 0; i < n; ++i) {
            p.x[i] = row.placeX[i];
            p.y[i] = row.placeY[i];
        }
    forGroups(groups, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const vec3 c = alongRay(pixelRay(lens, p.x[i] * inverse, p.y[i] * inverse), row.depth[i]);
            p.x[i] = c.x;
            p.y[i] = c.y;
            p.z[i] = c.z;
            p.reach2[i] = c.x * c.x + c.y * c.y + c.z * c.z;
        }
    });
}

/// What is turned away from a light gets none of it: it needs no mask.
[[gnu::always_inline]] inline void leaveFacing(const ShadowMap& m, const SurfaceRow& __restrict row, size_t first,
                                               size_t last, ShadowPixels& __restrict p) {
    const vec3 forward = m.forward;
    const float mayBeAway = m.isPerspective == 0u ? 1.0f : 0.0f;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const bool isAway = dot(forward, vec3(row.nx[i], row.ny[i], row.nz[i])) >= 0.0f;
        const float away = (isAway ? mayBeAway : 0.0f) * (row.leaf[i] < 0.5f ? 1.0f : 0.0f);
        p.left[i] = row.depth[i] > 0.0f ? 1.0f - away : 0.0f;
    }
}

/// Groups of which some pixels are left and near enough for a map.
[[gnu::always_inline]] inline uint32_t groupsWithin(const ShadowPixels& __restrict p, float reach2, uint32_t groups,
                                                    uint32_t n) {
    alignas(64) float within[kTile];
    forGroups(groups, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
        for (size_t i = first; i < last; ++i) within[i] = p.reach2[i] <= reach2 ? p.left[i] : 0.0f;
    });
    return groupsHeldOf(groups, n, within);
}

/// Pixels that are on a map are left for none of the next.
template <bool isPerspective>
[[gnu::always_inline]] inline void placeOnMap(const ShadowMap& map, float focal, size_t first, size_t last,
                                              ShadowPixels& pixels, const SurfaceRow& __restrict row,
                                              ShadowPlaces& out) {
    const ShadowMap m = map;
    ShadowPixels& __restrict p = pixels;
    ShadowPlaces& __restrict o = out;
    const Lens lens = lensHere(focal);
    const float edge = float(int(m.edge));
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const vec3 point = vec3(p.x[i], p.y[i], p.z[i]), normal = vec3(row.nx[i], row.ny[i], row.nz[i]);
        const ShadowPlace s = shadowPlace(m, isPerspective, point, normal, lensDepth(lens, p.z[i]));
        o.x[i] = s.x;
        o.y[i] = s.y;
        o.depth[i] = s.depth;
        o.slopeX[i] = s.slopeX;
        o.slopeY[i] = s.slopeY;
        o.whole[i] = s.whole;
        const bool isHeld = (s.x >= 0.0f) & (s.x < edge) & (s.y >= 0.0f) & (s.y < edge) &
                            (!isPerspective | (s.whole > 0.0f)) & (p.reach2[i] <= m.reach2);
        const float left = p.left[i];
        o.isOn[i] = isHeld ? left : 0.0f;
        p.left[i] = isHeld ? 0.0f : left;
    }
}

/// What comes past opaque casters to the places themselves.
[[gnu::always_inline]] inline void sharesHere(const ShadowMap& m, const float* __restrict depths, size_t first,
                                              size_t last, const ShadowPlaces& __restrict o, ShadowReads& reads,
                                              float* __restrict share) {
    ShadowReads& __restrict r = reads;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) r.at[i] = shadowTexels(m, o.x[i], o.y[i]).at00;
    readFour(depths, m.stride, r.at, first, last, r.upper, r.lower);
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i)
        share[i] = shareOfFour(o.at(i), shadowTexels(m, o.x[i], o.y[i]), r.upper[2 * i], r.upper[2 * i + 1],
                               r.lower[2 * i], r.lower[2 * i + 1]);
}

/// Borders are hard, and no leaf is met.
[[gnu::always_inline]] inline void hardShadows(const ShadowMap& map, const float* __restrict depths, size_t first,
                                               size_t last, const ShadowPlaces& __restrict o, ShadowReads& reads,
                                               uint32_t* __restrict word) {
    const ShadowMap m = map;
    alignas(64) float share[kTile];
    sharesHere(m, depths, first, last, o, reads, share);
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const uint32_t past = uint32_t(int(share[i] * 1023.0f + 0.5f));
        const uint32_t before = word[i];
        word[i] = o.isOn[i] > 0.5f ? past | past << 10 | past << 20 : before;
    }
}

/// Borders are hard. Where nothing is in the way, leaves need not be looked at. `groups`: with pixels on the map.
[[gnu::always_inline]] inline void leafShadows(const ShadowMap& map, const float* __restrict depths,
                                               const uint32_t* __restrict through, uint32_t groups, uint32_t n,
                                               const ShadowPlaces& __restrict o, ShadowReads& reads,
                                               uint32_t* __restrict word) {
    const ShadowMap m = map;
    ShadowReads& __restrict r = reads;
    alignas(64) float share[kTile], isMet[kTile];
    forGroups(groups, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
        sharesHere(m, depths, first, last, o, r, share);
        for (size_t i = first; i < last; ++i) isMet[i] = share[i] < 1.0f ? o.isOn[i] : 0.0f;
    });
    forGroups(groupsHeldOf(groups, n, isMet), n, [&](size_t first, size_t last) __attribute__((always_inline)) {
        readFour(through, m.stride, r.at, first, last, r.throughUpper, r.throughLower);
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const vec3 past = colourOfFour(o.at(i), shadowTexels(m, o.x[i], o.y[i]), r.upper[2 * i], r.upper[2 * i + 1],
                                           r.lower[2 * i], r.lower[2 * i + 1], r.throughUpper[2 * i],
                                           r.throughUpper[2 * i + 1], r.throughLower[2 * i], r.throughLower[2 * i + 1]);
            const uint32_t packed = packLight(past), before = word[i];
            word[i] = isMet[i] > 0.5f ? packed : before;
        }
    });
}

/// How wide penumbras are.
template <bool isPerspective>
[[gnu::always_inline]] inline void findPenumbras(const ShadowMap& map, const float* __restrict depths, size_t first,
                                                 size_t last, const ShadowPlaces& __restrict o, ShadowReads& reads,
                                                 ShadowTaps& taps) {
    const ShadowMap m = map;
    ShadowTaps& __restrict t = taps;
    ShadowReads& __restrict r = reads;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        t.reach[i] = casterReach(m, isPerspective, o.at(i));
        t.x[i] = t.firstX[i];
        t.y[i] = t.firstY[i];
        t.sum[i] = 0.0f;
        t.count[i] = 0.0f;
    }
    for (uint32_t k = 0; k < kShadowTaps; ++k) {
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const CasterTexel texel = casterTexel(m, o.at(i), t.reach[i], k, vec2(t.x[i], t.y[i]));
            r.column[i] = texel.column;
            r.row[i] = texel.row;
            r.at[i] = texel.at;
        }
        readOne(depths, r.at, first, last, r.depth);
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            ShadowCasters c;
            c.direction = vec2(t.x[i], t.y[i]);
            c.sum = t.sum[i];
            c.count = t.count[i];
            CasterTexel texel;
            texel.column = r.column[i];
            texel.row = r.row[i];
            texel.at = 0u;
            c = withCaster(o.at(i), texel, r.depth[i], c);
            t.x[i] = c.direction.x;
            t.y[i] = c.direction.y;
            t.sum[i] = c.sum;
            t.count[i] = c.count;
        }
    }
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        ShadowCasters c;
        c.direction = vec2(0.0f, 0.0f);
        c.sum = t.sum[i];
        c.count = t.count[i];
        t.radius[i] = penumbraOf(m, isPerspective, o.at(i), t.reach[i], c);
    }
}

/// Adds what comes past at place number k.
template <bool hasLeaves>
[[gnu::always_inline]] inline void addPast(const ShadowMap& m, const float* __restrict depths,
                                           const uint32_t* __restrict through, uint32_t k, size_t first, size_t last,
                                           const ShadowPlaces& __restrict o, ShadowReads& reads, ShadowTaps& taps) {
    ShadowTaps& __restrict t = taps;
    ShadowReads& __restrict r = reads;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const vec2 at = penumbraPlace(o.at(i), t.radius[i], k, vec2(t.x[i], t.y[i]));
        r.at[i] = shadowTexels(m, at.x, at.y).at00;
    }
    readFour(depths, m.stride, r.at, first, last, r.upper, r.lower);
    if (hasLeaves) readFour(through, m.stride, r.at, first, last, r.throughUpper, r.throughLower);
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const vec2 direction = vec2(t.x[i], t.y[i]);
        const vec2 at = penumbraPlace(o.at(i), t.radius[i], k, direction);
        const ShadowTexels texels = shadowTexels(m, at.x, at.y);
        const vec2 next = turnedGolden(direction);
        t.x[i] = next.x;
        t.y[i] = next.y;
        const float d00 = r.upper[2 * i], d10 = r.upper[2 * i + 1], d01 = r.lower[2 * i], d11 = r.lower[2 * i + 1];
        if (!hasLeaves) {
            t.red[i] += shareOfFour(o.at(i), texels, d00, d10, d01, d11);
            continue;
        }
        const vec3 past = colourOfFour(o.at(i), texels, d00, d10, d01, d11, r.throughUpper[2 * i],
                                       r.throughUpper[2 * i + 1], r.throughLower[2 * i], r.throughLower[2 * i + 1]);
        t.red[i] += past.x;
        t.green[i] += past.y;
        t.blue[i] += past.z;
    }
}

/// Of lights that have a size. `groups`: with pixels on the map.
template <bool isPerspective, bool hasLeaves>
[[gnu::always_inline]] inline void softShadows(const ShadowMap& map, const float* depths, const uint32_t* through,
                                               uint32_t groups, uint32_t n, const ShadowPlaces& __restrict o,
                                               ShadowReads& reads, ShadowTaps& taps, uint32_t* __restrict word) {
    const ShadowMap m = map;
    ShadowTaps& __restrict t = taps;
    const auto each = [&](uint32_t of, const auto& use) __attribute__((always_inline)) {
        forGroups(of & groups, n, use);
    };
    each(groups, [&](size_t first, size_t last) __attribute__((always_inline)) {
        findPenumbras<isPerspective>(m, depths, first, last, o, reads, t);
    });
    alignas(64) float isMet[kTile];
    each(groups, [&](size_t first, size_t last) __attribute__((always_inline)) {
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const float radius = t.radius[i];
            isMet[i] = radius < 0.0f ? 0.0f : o.isOn[i];  // what is no number takes one lookup
            t.isWide[i] = radius > 0.0f ? o.isOn[i] : 0.0f;
            t.x[i] = t.firstX[i];
            t.y[i] = t.firstY[i];
            t.red[i] = t.green[i] = t.blue[i] = 0.0f;
        }
    });
    const uint32_t met = groupsHeldOf(groups, n, isMet), wide = groupsHeldOf(groups, n, t.isWide);
    const auto add = [&](uint32_t k, uint32_t of) __attribute__((always_inline)) {
        each(
            of, [&](size_t first, size_t last) __attribute__((always_inline)) {
                addPast<hasLeaves>(m, depths, through, k, first, last, o, reads, t);
            });
    };
    add(0, met);
    // Of borders that are hard in a penumbra's neighbourhood the first place is all there is.
    alignas(64) float one[3][kTile];
    each(wide, [&](size_t first, size_t last) __attribute__((always_inline)) {
        for (size_t i = first; i < last; ++i) {
            one[0][i] = t.red[i];
            one[1][i] = t.green[i];
            one[2][i] = t.blue[i];
        }
    });
    for (uint32_t k = 1; k < kShadowTaps && wide != 0u; ++k) add(k, wide);
    each(wide, [&](size_t first, size_t last) __attribute__((always_inline)) {
        constexpr float kInverse = 1.0f / float(int(kShadowTaps));
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const bool isWide = t.isWide[i] > 0.5f;
            t.red[i] = isWide ? t.red[i] * kInverse : one[0][i];
            t.green[i] = isWide ? t.green[i] * kInverse : one[1][i];
            t.blue[i] = isWide ? t.blue[i] * kInverse : one[2][i];
        }
    });
    each(met, [&](size_t first, size_t last) __attribute__((always_inline)) {
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const float red = t.red[i];
            const uint32_t past = packLight(vec3(red, hasLeaves ? t.green[i] : red, hasLeaves ? t.blue[i] : red));
            const uint32_t before = word[i];
            word[i] = isMet[i] > 0.5f ? past : before;
        }
    });
}

void shadowRow(const FrameConstants& frame, const ShadowInput& in, uint32_t x0, uint32_t y, uint32_t n,
               SurfaceRow& __restrict row) {
    const FrameConstants f = frame;
    ShadowPixels p;
    ShadowPlaces o;
    ShadowReads r;
    ShadowTaps t;
    const uint32_t seen = groupsHeld(n, row.depth);
    placePixels(f, row, x0, y, seen, n, p);
    for (uint32_t s = 0; s < in.slots; ++s)
        for (size_t i = 0; i < n; ++i) row.shadow[s][i] = kAllLight;
    row.shadowSlots = in.slots;
    bool hasTaps = false;
    uint32_t slot = ~0u, left = 0;
    for (uint32_t k = 0; k < in.count; ++k) {
        const ShadowMap& m = in.maps[k];
        if (m.slot != slot) {
            slot = m.slot;
            left = seen;
            forGroups(seen, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
                leaveFacing(m, row, first, last, p);
            });
        }
        left = groupsHeldOf(left, n, p.left);
        const uint32_t groups = groupsWithin(p, m.reach2, left, n);
        if (groups == 0u) continue;
        const bool isPerspective = m.isPerspective != 0u;
        forGroups(groups, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
            if (isPerspective)
                placeOnMap<true>(m, f.focal, first, last, p, row, o);
            else
                placeOnMap<false>(m, f.focal, first, last, p, row, o);
        });
        const uint32_t on = groupsHeldOf(groups, n, o.isOn);
        uint32_t* const word = row.shadow[slot];
        if (!(m.size > 0.0f) && m.hasLeaves == 0u) {
            forGroups(on, n, [&](size_t first, size_t last) __attribute__((always_inline)) {
                hardShadows(m, in.depths[k], first, last, o, r, word);
            });
            continue;
        }
        if (!(m.size > 0.0f)) {
            leafShadows(m, in.depths[k], in.through[k], on, n, o, r, word);
            continue;
        }
        if (!hasTaps)
            for (size_t i = 0; i < n; ++i) {
                const vec2 first = firstGolden(x0 + uint32_t(i), y, f.coverageSeed);
                t.firstX[i] = first.x;
                t.firstY[i] = first.y;
            }
        hasTaps = true;
        if (isPerspective && m.hasLeaves != 0u)
            softShadows<true, true>(m, in.depths[k], in.through[k], on, n, o, r, t, word);
        else if (isPerspective)
            softShadows<true, false>(m, in.depths[k], in.through[k], on, n, o, r, t, word);
        else if (m.hasLeaves != 0u)
            softShadows<false, true>(m, in.depths[k], in.through[k], on, n, o, r, t, word);
        else
            softShadows<false, false>(m, in.depths[k], in.through[k], on, n, o, r, t, word);
    }
    for (uint32_t k = 0; k < in.slots; ++k) {
        uint32_t lost = 0;
        for (size_t i = 0; i < n; ++i) lost |= row.shadow[k][i] ^ kAllLight;
        row.isShadowed[k] = lost != 0;
    }
}
