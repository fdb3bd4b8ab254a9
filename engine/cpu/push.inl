// From coarse texels to fine ones. Fine texels with even and with odd numbers are worked out apart: the coarse texels
// around those of either kind lie side by side. Included by kernels.inl.

void coarseDiscs(CoarseRow& __restrict row, uint32_t n, float x, float y, float size, float focal) {
    const Lens lens = lensHere(focal);
    const TexelRow& __restrict texels = row.texels;
    // (As bits: of a condition that is the same for all, GCC makes no SIMD. Of rows without tubes isRound is not set.)
    const uint32_t hasTubes = texels.hasTubes ? ~0u : 0u;
#pragma GCC ivdep
    for (size_t i = 0; i < (n + 1) / 2 + 2; ++i) {
        const size_t at = kPad - 1 + i;
        Texel t{};
        t.depth = texels.depth[at];
        t.radius = texels.radius[at];
        t.thickness = texels.thickness[at];
        t.offset = vec2(texels.x[at], texels.y[at]);
        t.normalPerp = vec2(texels.perpX[at], texels.perpY[at]);
        t.isRound = uintBitsToFloat(floatBitsToUint(texels.isRound[at]) & hasTubes);
        const CoarseDisc d = coarseDisc(t, x + (float(int(i)) - 1.0f) * size, y, lens);
        row.slopeX[at] = d.slope.x;
        row.slopeY[at] = d.slope.y;
        row.inverseDepth[at] = d.inverseDepth;
        row.facing[at] = d.facing;
        row.front[at] = d.front;
        row.end[at] = d.end;
        row.kinds[at] = d.kinds;
    }
}

[[gnu::always_inline]] inline CoarseDisc discAt(const CoarseRow& row, size_t i) {
    CoarseDisc d;
    d.slope = vec2(row.slopeX[i], row.slopeY[i]);
    d.inverseDepth = row.inverseDepth[i];
    d.facing = row.facing[i];
    d.front = row.front[i];
    d.end = row.end[i];
    d.kinds = row.kinds[i];
    return d;
}

/// What a push works out of each texel before it blends: of even and odd ones apart, by the number of their parent.
struct PushedRow {
    static constexpr uint32_t kSize = kTile / 2 + 2 * kTexelGroup;
    alignas(64) float isInside[kSize], reach2[kSize], hindmost[kSize];  // PushCell between a parent and the one before
    alignas(64) float depth[2][kSize], isMissed[2][kSize];              // PushedTo
    alignas(64) float rho2[2][4][kSize], share[2][4][kSize], isRound[2][kSize], isReplaced[2][kSize];
    PushCell cellAt(size_t i) const {
        PushCell c;
        c.isInside = isInside[i];
        c.reach2 = reach2[i];
        c.hindmost = hindmost[i];
        return c;
    }
    PushedTo toAt(size_t odd, size_t i) const {
        PushedTo to;
        to.depth = depth[odd][i];
        to.isMissed = isMissed[odd][i];
        return to;
    }
    OfFour rho2At(size_t odd, size_t i) const {
        return ofFour(rho2[odd][0][i], rho2[odd][1][i], rho2[odd][2][i], rho2[odd][3][i]);
    }
    template <bool hasTubes>
    PushShares sharesAt(size_t odd, size_t i) const {
        PushShares s;
        s.of = ofFour(share[odd][0][i], share[odd][1][i], share[odd][2][i], share[odd][3][i]);
        s.isRound = hasTubes ? isRound[odd][i] : 0.0f;
        s.isReplaced = isReplaced[odd][i];
        return s;
    }
};

/// Coarse texels that a push reads, and where the fine ones are.
template <bool hasTubes, bool hasMaterials>
struct PushFrom {
    const TexelRow& __restrict fine;
    const CoarseRow& __restrict nearRow;
    const CoarseRow& __restrict farRow;
    float sy, x, y, fineSize;
    Lens lens;

    static size_t beside(size_t odd, size_t i) { return odd == 0 ? i - 1 : i + 1; }
    static float side(size_t odd) { return odd == 0 ? -1.0f : 1.0f; }
    /// Calls use(q0, q1, q2, q3) with get(row, entry) of the four around a fine texel.
    template <typename Get, typename Use>
    [[gnu::always_inline]] auto ofFourAt(size_t odd, size_t i, const Get& get, const Use& use) const {
        const size_t at = kPad + i, other = beside(odd, at);
        return use(get(nearRow, at), get(nearRow, other), get(farRow, at), get(farRow, other));
    }
    template <typename Get>
    [[gnu::always_inline]] OfFour numbersAt(size_t odd, size_t i, const Get& get) const {
        return ofFourAt(
            odd, i, get,
            [](float a, float b, float c, float d) __attribute__((always_inline)) { return ofFour(a, b, c, d); });
    }
    [[gnu::always_inline]] static Texel texel(const CoarseRow& row, size_t at) {
        return texelAt<hasTubes, hasMaterials>(row.texels, at);
    }
    [[gnu::always_inline]] Texel own(size_t odd, size_t i) const {
        return texelAt<hasTubes, hasMaterials>(fine, kPad + 2 * i + odd);
    }
    [[gnu::always_inline]] OfFour atX(size_t odd, size_t i) const {
        return ofFourAt(
            odd, i,
            texel, [&](const Texel& a, const Texel& b, const Texel& c, const Texel& d) __attribute__((always_inline)) {
                return pushX(a, b, c, d, side(odd), fineSize);
            });
    }
    [[gnu::always_inline]] OfFour atY(size_t odd, size_t i) const {
        return ofFourAt(
            odd, i,
            texel, [&](const Texel& a, const Texel& b, const Texel& c, const Texel& d) __attribute__((always_inline)) {
                return pushY(a, b, c, d, sy, fineSize);
            });
    }
    /// All of a texel but its normal.
    [[gnu::always_inline]] Texel blended(size_t odd, size_t i, float depth, const PushShares& s) const {
        const OfFour linear = numbersAt(
            odd, i,
            [](const CoarseRow& row, size_t at) __attribute__((always_inline)) { return row.inverseDepth[at]; });
        Texel before = own(odd, i);
        before.depth = depth;
        return chosenTexel(
            s.isReplaced > 0.5f,
            ofFourAt(
                odd, i, texel,
                [&](const Texel& a, const Texel& b, const Texel& c, const Texel& d) __attribute__((always_inline)) {
                    return pushBlend(a, b, c, d, linear, atX(odd, i), atY(odd, i), vec3(0.0f, 0.0f, 0.0f), s, lens);
                }),
            before);
    }
};

/// rho^2 of the four around even or odd texels.
template <bool odd, typename From>
[[gnu::always_inline]] inline void pushDistances(const From& from, size_t first, size_t last,
                                                 PushedRow& __restrict pushed) {
    float *__restrict const r0 = pushed.rho2[odd][0], *__restrict const r1 = pushed.rho2[odd][1],
                            *__restrict const r2 = pushed.rho2[odd][2], *__restrict const r3 = pushed.rho2[odd][3];
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const OfFour atX = from.atX(odd, i), atY = from.atY(odd, i);
        const float px = from.x + float(int(2 * i + (odd ? 1 : 0))) * from.fineSize;
        const size_t at = kPad + i, other = From::beside(odd, at);
        r0[i] =
            pushRho2(From::texel(from.nearRow, at), discAt(from.nearRow, at), px, from.y, atX.of0, atY.of0, from.lens);
        r1[i] = pushRho2(From::texel(from.nearRow, other), discAt(from.nearRow, other), px, from.y, atX.of1, atY.of1,
                         from.lens);
        r2[i] =
            pushRho2(From::texel(from.farRow, at), discAt(from.farRow, at), px, from.y, atX.of2, atY.of2, from.lens);
        r3[i] = pushRho2(From::texel(from.farRow, other), discAt(from.farRow, other), px, from.y, atX.of3, atY.of3,
                         from.lens);
    }
}

/// How much each of them counts.
template <bool odd, bool hasTubes, typename From>
[[gnu::always_inline]] inline void pushSharesOf(const From& from, size_t first, size_t last,
                                                PushedRow& __restrict pushed) {
    float *__restrict const w0 = pushed.share[odd][0], *__restrict const w1 = pushed.share[odd][1],
                            *__restrict const w2 = pushed.share[odd][2], *__restrict const w3 = pushed.share[odd][3],
                            *__restrict const isRound = pushed.isRound[odd],
                            *__restrict const isReplaced = pushed.isReplaced[odd];
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i) {
        const auto front = [](const CoarseRow& row, size_t at) __attribute__((always_inline)) { return row.front[at]; };
        const auto end = [](const CoarseRow& row, size_t at) __attribute__((always_inline)) { return row.end[at]; };
        const auto tube = [](const CoarseRow& row, size_t at) __attribute__((always_inline)) {
            return hasTubes ? row.texels.isRound[at] : 0.0f;
        };
        const PushShares s = pushShares(pushed.toAt(odd, i), from.numbersAt(odd, i, front), from.numbersAt(odd, i, end),
                                        from.numbersAt(odd, i, tube), pushed.rho2At(odd, i), pushed.cellAt(i + odd));
        w0[i] = s.of.of0;
        w1[i] = s.of.of1;
        w2[i] = s.of.of2;
        w3[i] = s.of.of3;
        if (hasTubes) isRound[i] = s.isRound;
        isReplaced[i] = s.isReplaced;
    }
}

/// Of an even and an odd texel. (Of a loop over both GCC makes no SIMD.)
template <typename Use>
[[gnu::always_inline]] inline void forBoth(const Use& use) {
    use(size_t{0});
    use(size_t{1});
}

/// Their normals.
template <bool hasTubes, typename From>
[[gnu::always_inline]] inline void pushNormals(const From& from, size_t first, size_t last, const PushedRow& pushed,
                                               TexelRow& __restrict out) {
    const auto normal = [](const CoarseRow& row, size_t at) __attribute__((always_inline)) {
        return vec3(row.texels.perpX[at], row.texels.perpY[at], row.facing[at]);
    };
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i)
        forBoth([&](size_t odd) __attribute__((always_inline)) {
            const size_t at = kPad + 2 * i + odd;
            const PushShares s = pushed.template sharesAt<hasTubes>(odd, i);
            const auto sum = [&](vec3 a, vec3 b, vec3 c, vec3 d) __attribute__((always_inline)) {
                return pushNormal(a, b, c, d, s);
            };
            const vec3 n = from.ofFourAt(odd, i, normal, sum);
            const vec2 p = blendedPerp(n, s.of.of0 + s.of.of1 + s.of.of2 + s.of.of3, s.isRound);
            const Texel own = from.own(odd, i);
            const bool isReplaced = s.isReplaced > 0.5f;
            out.perpX[at] = isReplaced ? p.x : own.normalPerp.x;
            out.perpY[at] = isReplaced ? p.y : own.normalPerp.y;
        });
}

/// In one loop after the other: together they would need more registers than there are, and what each waits for
/// (divisions, roots) is longer than what a processor looks ahead. [first, last): parents.
template <bool hasTubes, bool hasMaterials>
[[gnu::always_inline]] inline void pushTexelRow(const PushFrom<hasTubes, hasMaterials>& from, size_t first, size_t last,
                                                bool coloursAlone, PushedRow& __restrict pushed,
                                                TexelRow& __restrict out) {
    // (Whole groups, though one entry more would do: GCC goes through what is left one by one.)
#pragma GCC ivdep
    for (size_t i = first; i < last + kTexelGroup; ++i) {
        const size_t at = kPad + i;
        const PushCell c = pushCell(discAt(from.nearRow, at), discAt(from.nearRow, at - 1), discAt(from.farRow, at),
                                    discAt(from.farRow, at - 1), from.fineSize);
        pushed.isInside[i] = c.isInside;
        pushed.reach2[i] = c.reach2;
        pushed.hindmost[i] = c.hindmost;
    }
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i)
        forBoth([&](size_t odd) __attribute__((always_inline)) {
            const PushedTo to = pushedTo(from.own(odd, i), from.fineSize);
            pushed.depth[odd][i] = to.depth;
            pushed.isMissed[odd][i] = to.isMissed;
        });
    pushDistances<false>(from, first, last, pushed);
    pushDistances<true>(from, first, last, pushed);
    pushSharesOf<false, hasTubes>(from, first, last, pushed);
    pushSharesOf<true, hasTubes>(from, first, last, pushed);
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i)
        forBoth([&](size_t odd) __attribute__((always_inline)) {
            const size_t at = kPad + 2 * i + odd;
            const Texel t = from.blended(odd, i, pushed.depth[odd][i], pushed.template sharesAt<hasTubes>(odd, i));
            out.depth[at] = t.depth;
            out.red[at] = t.colour.x;
            out.green[at] = t.colour.y;
            out.blue[at] = t.colour.z;
        });
    if (hasMaterials)
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i)
            forBoth([&](size_t odd) __attribute__((always_inline)) {
                const size_t at = kPad + 2 * i + odd;
                const Texel t = from.blended(odd, i, pushed.depth[odd][i], pushed.template sharesAt<hasTubes>(odd, i));
                out.share[at] = t.surface.share;
                out.metallic[at] = t.surface.metallic;
                out.roughness[at] = t.surface.roughness;
            });
    if (coloursAlone && !hasTubes) return;
    pushNormals<hasTubes>(from, first, last, pushed, out);
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i)
        forBoth([&](size_t odd) __attribute__((always_inline)) {
            const size_t at = kPad + 2 * i + odd;
            const Texel t = from.blended(odd, i, pushed.depth[odd][i], pushed.template sharesAt<hasTubes>(odd, i));
            out.radius[at] = t.radius;
            out.thickness[at] = t.thickness;
            out.x[at] = t.offset.x;
            out.y[at] = t.offset.y;
        });
    if (!hasTubes) return;
#pragma GCC ivdep
    for (size_t i = first; i < last; ++i)
        forBoth([&](size_t odd) __attribute__((always_inline)) {
            const size_t at = kPad + 2 * i + odd;
            const Texel t = from.blended(odd, i, pushed.depth[odd][i], pushed.template sharesAt<hasTubes>(odd, i));
            out.isRound[at] = t.isRound;
            out.axisX[at] = t.axis.x;
            out.axisY[at] = t.axis.y;
        });
}

/// Of groups of fine texels those of their parents: a group of these is two of those.
[[gnu::always_inline]] inline uint32_t parentGroups(uint32_t groups) {
    uint32_t parents = 0;
    for (uint32_t g = 0; g < kTile / kTexelGroup; g += 2) parents |= ((groups >> g & 3u) != 0u ? 1u : 0u) << g / 2;
    return parents;
}

void pushRow(const TexelRow& fine, const CoarseRow& nearRow, const CoarseRow& farRow, float sy, float x, float y,
             uint32_t n, uint32_t wanted, float fineSize, float focal, bool coloursAlone, TexelRow& out) {
    static_assert(kTile % (2 * kTexelGroup) == 0 && kTile / kTexelGroup < 32);
    const uint32_t count = (n + 1) / 2;
    // Parents and those before and behind them: a group has some where the next texel beside it is there.
    const auto at = [](const CoarseRow& row) { return row.texels.depth + kPad; };
    uint32_t held =
        groupsHeld(count, at(nearRow), at(farRow), at(nearRow) - 1, at(farRow) - 1, at(nearRow) + 1, at(farRow) + 1);
    held = (held | parentGroups(groupsHeld(n, fine.depth + kPad))) & parentGroups(wanted);
    for (size_t i = 0; i < n; ++i) out.depth[kPad + i] = 0.0f;
    PushedRow pushed;
    forRow(out.hasTubes, out.hasMaterials, [&]<bool hasTubes, bool hasMaterials>() {
        const PushFrom<hasTubes, hasMaterials> from{fine, nearRow, farRow, sy, x, y, fineSize, lensHere(focal)};
        forGroups(
            held, kTile / 2, [&](size_t first, size_t last) __attribute__((always_inline)) {
                pushTexelRow(from, first, last, coloursAlone, pushed, out);
            });
    });
}
