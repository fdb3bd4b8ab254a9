// Reflections of the screen (shaders/shared/reflection.h), for the pixels of a row. Included by kernels.inl, once per
// instruction set.

/// Pixels of a row that mirror the picture, closed up, and their rays.
struct alignas(64) MirrorLanes {
    uint32_t at[kTile];
    float px[kTile], depth[kTile], nx[kTile], ny[kTile], nz[kTile], roughness[kTile];
    float rx[kTile], ry[kTile], rz[kTile], x[kTile], y[kTile], dx[kTile], dy[kTile], linear[kTile], dLinear[kTile];
    float steps[kTile], onePixel[kTile], share[kTile];
    float isInFront[kTile];                       // of the step before
    float passed[kTile];                          // the last step that has passed behind something
    float things[kTile];                          // that were passed
    float found[kTile];                           // the step that meets something, or 0
    float low[kTile], high[kTile];                // between which shares of the way
    float off[kTile];                             // there, mirrorOff
    float hitX[kTile], hitY[kTile];               // px
    float metR[kTile], metG[kTile], metB[kTile];  // of what is met, less what would be seen without it
    float farR[kTile], farG[kTile], farB[kTile];  // that
    float counted[kTile];                         // shares of pixels about the place that do not turn their back
};

[[gnu::always_inline]] inline size_t takeMirrors(const FrameConstants& f, const ReflectionInput& in, size_t first,
                                                 float offX, uint32_t n, MirrorLanes& m) {
    size_t count = 0;
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t word = in.material[first + i];
        if (!(in.depth[first + i] > 0.0f) || !isMirror(word, f.shade)) continue;
        const vec3 normal = octDecode(in.normal[first + i]);
        m.at[count] = i;
        m.px[count] = offX + float(int(i));
        m.depth[count] = in.depth[first + i];
        m.nx[count] = normal.x;
        m.ny[count] = normal.y;
        m.nz[count] = normal.z;
        m.roughness[count++] = float(int(word >> 8 & 255u)) * (1.0f / 255.0f);
    }
    return count;
}

/// A surface of a lane, as light sees it; `py`: of the row, px from the principal point.
[[gnu::always_inline]] inline vec3 towardsEye(const Lens& lens, float px, float py) {
    const float inverseFocal = 1.0f / lens.focal;
    const vec3 e = rayDirection(pixelRay(lens, px * inverseFocal, py * inverseFocal));
    const float inverse = -1.0f / std::sqrt(e.x * e.x + e.y * e.y + 1.0f);
    return vec3(e.x * inverse, e.y * inverse, inverse);
}
[[gnu::always_inline]] inline vec3 placeOf(const Lens& lens, float px, float py, float depth) {
    const float inverseFocal = 1.0f / lens.focal;
    return alongRay(pixelRay(lens, px * inverseFocal, py * inverseFocal), depth);
}

[[gnu::always_inline]] inline void startRays(const FrameConstants& f, const ReflectionConstants& of, float py,
                                             size_t count, MirrorLanes& lanes) {
    MirrorLanes& __restrict m = lanes;
    const ReflectionConstants c = of;
    const Lens lens = lensHere(f.focal);
    const vec2 centre(f.centre.x, f.centre.y), size(float(int(f.width)), float(int(f.height)));
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const MirrorRay r = mirrorRay(c, lens, centre, size, placeOf(lens, m.px[i], py, m.depth[i]),
                                      vec3(m.nx[i], m.ny[i], m.nz[i]), towardsEye(lens, m.px[i], py), m.roughness[i]);
        m.rx[i] = r.direction.x;
        m.ry[i] = r.direction.y;
        m.rz[i] = r.direction.z;
        m.x[i] = r.x;
        m.y[i] = r.y;
        m.dx[i] = r.dx;
        m.dy[i] = r.dy;
        m.linear[i] = r.linear;
        m.dLinear[i] = r.dLinear;
        m.steps[i] = r.share > 0.0f ? r.steps : 0.0f;
        m.onePixel[i] = r.onePixel;
        m.share[i] = r.share;
        m.passed[i] = 0.0f;
        m.things[i] = 0.0f;
        m.found[i] = 0.0f;
    }
}

/// Groups of rays of which some go on.
[[gnu::always_inline]] inline uint32_t groupsGoing(const MirrorLanes& __restrict m, uint32_t groups, float step,
                                                   size_t count) {
    alignas(64) float going[kTile];
    forGroups(groups, uint32_t(count), [&](size_t first, size_t last) __attribute__((always_inline)) {
        for (size_t i = first; i < last; ++i) going[i] = m.found[i] > 0.0f ? 0.0f : m.steps[i] - step;
    });
    return groupsHeldOf(groups, uint32_t(count), going);
}

/// From step `from` on, which no ray that is not there yet has passed behind something after.
[[gnu::always_inline]] inline void followRays(const FrameConstants& f, const float* __restrict depths, uint32_t groups,
                                              uint32_t from, uint32_t steps, size_t count, MirrorLanes& lanes) {
    MirrorLanes& __restrict m = lanes;
    const Lens lens = lensHere(f.focal);
    const float width = float(int(f.width)), height = float(int(f.height));
    const int pitch = int(f.width);
    constexpr uint32_t kLook = 4;  // steps after which rays are looked at whether any goes on
    for (size_t i = 0; i < count; ++i) m.isInFront[i] = 1.0f;
    uint32_t going = groupsGoing(m, groups, 0.0f, count);
    for (uint32_t step = from; step <= steps && going != 0u; ++step) {
        const float k = float(int(step));
        forGroups(going, uint32_t(count), [&](size_t first, size_t last) __attribute__((always_inline)) {
#pragma GCC ivdep
            for (size_t i = first; i < last; ++i) {
                const float share = k / max(m.steps[i], 1.0f);
                const float x = m.x[i] + share * m.dx[i], y = m.y[i] + share * m.dy[i];
                const float z = mirrorDepth(lens, m.linear[i], m.dLinear[i], share);
                const float depth = depths[mirrorPixel(y, height) * pitch + mirrorPixel(x, width)];
                const float behind = mirrorBehind(z, depth);
                const float found = m.found[i], mayMeet = (found > 0.0f ? 0.0f : m.isInFront[i]);
                const float isNew = (k > m.passed[i] ? 1.0f : 0.0f) * (k <= m.steps[i] ? 1.0f : 0.0f);
                const float meets = mayMeet * isNew * (behind > 0.0f ? 1.0f : 0.0f);
                m.found[i] = meets > 0.5f ? k : found;
                m.isInFront[i] = behind > 0.0f ? 0.0f : 1.0f;
            }
        });
        if (step % kLook == 0) going = groupsGoing(m, going, k, count);
    }
}

[[gnu::always_inline]] inline void narrowSteps(const FrameConstants& f, const float* __restrict depths, uint32_t groups,
                                               size_t count, MirrorLanes& lanes) {
    MirrorLanes& __restrict m = lanes;
    const Lens lens = lensHere(f.focal);
    const float width = float(int(f.width)), height = float(int(f.height));
    const int pitch = int(f.width);
    forGroups(groups, uint32_t(count), [&](size_t first, size_t last) __attribute__((always_inline)) {
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const float inverse = 1.0f / max(m.steps[i], 1.0f);
            m.low[i] = max(m.found[i] - 1.0f, 0.0f) * inverse;
            m.high[i] = m.found[i] * inverse;
        }
        for (uint32_t h = 0; h < kMirrorHalvings; ++h)
#pragma GCC ivdep
            for (size_t i = first; i < last; ++i) {
                const float share = 0.5f * (m.low[i] + m.high[i]);
                const float x = m.x[i] + share * m.dx[i], y = m.y[i] + share * m.dy[i];
                const float depth = depths[mirrorPixel(y, height) * pitch + mirrorPixel(x, width)];
                const bool isBehind =
                    mirrorBehind(mirrorDepth(lens, m.linear[i], m.dLinear[i], share), depth) > 0.0f;
                m.low[i] = isBehind ? m.low[i] : share;
                m.high[i] = isBehind ? share : m.high[i];
            }
    });
}

/// Rays that are too far behind what they were to meet go on, the others do not: groups of which some do. `from`: the
/// first step that one of them has come to.
[[gnu::always_inline]] inline uint32_t passBehind(const FrameConstants& f, const float* __restrict depths,
                                                  const uint32_t* __restrict normals, uint32_t groups, size_t count,
                                                  MirrorLanes& lanes, uint32_t& from) {
    MirrorLanes& __restrict m = lanes;
    const Lens lens = lensHere(f.focal);
    const float width = float(int(f.width)), height = float(int(f.height));
    const float centreX = f.centre.x, centreY = f.centre.y;
    const int pitch = int(f.width);
    alignas(64) float passes[kTile];
    forGroups(groups, uint32_t(count), [&](size_t first, size_t last) __attribute__((always_inline)) {
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const float x = m.x[i] + m.high[i] * m.dx[i], y = m.y[i] + m.high[i] * m.dy[i];
            const float z = mirrorDepth(lens, m.linear[i], m.dLinear[i], m.high[i]),
                        back = m.high[i] - m.onePixel[i];
            const float zBack = mirrorDepth(lens, m.linear[i], m.dLinear[i], back);
            const int column = mirrorPixel(x, width), line = mirrorPixel(y, height), at = line * pitch + column;
            const float on = kMirrorAhead * m.onePixel[i];
            const int next = mirrorPixel(y + on * m.dy[i], height) * pitch + mirrorPixel(x + on * m.dx[i], width);
            const vec3 toEye = towardsEye(lens, float(column) + 0.5f - centreX, float(line) + 0.5f - centreY);
            const vec3 n = octDecode(normals[at]);
            m.off[i] = mirrorOff(lens, z, zBack, depths[at], std::abs(dot(n, toEye)), depths[next]);
            const float meets = mirrorMeets(m.off[i], n, vec3(m.rx[i], m.ry[i], m.rz[i])) ? 1.0f : 0.0f;
            passes[i] = (m.found[i] > 0.0f ? 1.0f : 0.0f) * (1.0f - meets);
        }
    });
    const uint32_t going = groupsHeldOf(groups, uint32_t(count), passes);
    float least = 3.0e38f;
    forGroups(groups, uint32_t(count), [&](size_t first, size_t last) __attribute__((always_inline)) {
        for (size_t i = first; i < last; ++i) least = passes[i] > 0.0f ? min(least, m.found[i]) : least;
#pragma GCC ivdep
        for (size_t i = first; i < last; ++i) {
            const bool goesOn = passes[i] > 0.0f;
            m.steps[i] = (goesOn ? 1.0f : m.found[i]) > 0.0f ? m.steps[i] : 0.0f;
            m.passed[i] = goesOn ? m.found[i] : m.passed[i];
            m.things[i] += goesOn ? 1.0f : 0.0f;
            m.found[i] = goesOn ? 0.0f : m.found[i];
        }
    });
    from = going != 0u ? uint32_t(int(least)) : 1u;
    return going;
}

/// Where rays meet something, and how much that counts.
[[gnu::always_inline]] inline void weighHits(const FrameConstants& f, const ReflectionInput& in, float py, size_t count,
                                             MirrorLanes& lanes) {
    MirrorLanes& __restrict m = lanes;
    const ReflectionConstants c = in.constants;
    const Lens lens = lensHere(f.focal);
    const uint32_t* const __restrict normals = in.normal;
    const float centreX = f.centre.x, centreY = f.centre.y;
    const vec2 size(float(int(f.width)), float(int(f.height)));
    const int pitch = int(f.width);
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const float x = m.x[i] + m.high[i] * m.dx[i], y = m.y[i] + m.high[i] * m.dy[i];
        const float z = mirrorDepth(lens, m.linear[i], m.dLinear[i], m.high[i]);
        const int at = mirrorPixel(y, size.y) * pitch + mirrorPixel(x, size.x);
        const vec3 own = placeOf(lens, m.px[i], py, m.depth[i]), hit = placeOf(lens, x - centreX, y - centreY, z);
        const vec3 way(hit.x - own.x, hit.y - own.y, hit.z - own.z);
        const float hitShare = mirrorHit(c, size, vec3(m.rx[i], m.ry[i], m.rz[i]), octDecode(normals[at]), x, y,
                                         m.off[i], std::sqrt(dot(way, way)));
        m.hitX[i] = x;
        m.hitY[i] = y;
        m.share[i] = m.found[i] > 0.0f ? m.share[i] * mirrorPassed(m.things[i]) * hitShare : 0.0f;
    }
}

/// Pixels of the picture in a row, at the places of those that mirror them.
struct MetRow {
    alignas(64) float x[kTile], y[kTile], share[kTile];  // px from the principal point
    SurfaceRow row;
    /// What else it has is of other rows, and of pixels that are not lit.
    void clear(const ReflectionInput& in, uint32_t n) {
        row.shadowSlots = 0;
        row.hasTriangles = row.hasMaterials = true;
        row.hasOcclusion = in.hasOcclusion;
        row.hasEmission = in.emissive != nullptr;
        row.placeX = x;
        row.placeY = y;
        for (uint32_t i = 0; i < n; ++i) {
            row.depth[i] = 0.0f;
            row.material[i] = kPixelTriangle | kPixelUnlit;
        }
    }
    /// Gives the share that it counts, if only as nothing.
    float take(const FrameConstants& f, const ReflectionInput& in, uint32_t i, const MirrorTap& tap, vec3 direction) {
        const size_t at = size_t(uint32_t(tap.y)) * f.width + uint32_t(tap.x);
        const bool isThere = in.depth[at] > 0.0f;
        const vec3 n = octDecode(in.normal[at]);
        const bool isAway = isThere && dot(n, direction) >= 0.0f;
        share[i] = isThere && !isAway ? tap.share : 0.0f;
        x[i] = float(tap.x) + 0.5f - f.centre.x;
        y[i] = float(tap.y) + 0.5f - f.centre.y;
        row.depth[i] = isThere ? in.depth[at] : 0.0f;
        row.material[i] = isThere ? in.material[at] : kPixelTriangle | kPixelUnlit;
        row.nx[i] = n.x;
        row.ny[i] = n.y;
        row.nz[i] = n.z;
        row.red[i] = unpackRed(in.colour[at]);
        row.green[i] = unpackGreen(in.colour[at]);
        row.blue[i] = unpackBlue(in.colour[at]);
        row.leaf[i] = (row.material[i] & kPixelLeaf) != 0u ? 1.0f : 0.0f;
        if (row.hasEmission) row.emission[i] = (row.material[i] & kPixelTriangle) != 0u ? in.emissive[at] : 0u;
        return isAway ? 0.0f : tap.share;
    }
};

[[gnu::always_inline]] inline Surface mirrorOf(const ReflectionInput& in, const Lens& lens, const MirrorLanes& m,
                                               size_t i, size_t at, float py) {
    Surface s;
    s.colour = vec3(unpackRed(in.colour[at]), unpackGreen(in.colour[at]), unpackBlue(in.colour[at]));
    s.normal = vec3(m.nx[i], m.ny[i], m.nz[i]);
    s.toEye = towardsEye(lens, m.px[i], py);
    s.metallic = float(int(in.material[at] & 255u)) * (1.0f / 255.0f);
    s.roughness = m.roughness[i];
    s.occlusion = wordOcclusion(in.material[at]);
    s.leaf = 0.0f;
    s.dielectric = vec3(kDielectric, kDielectric, kDielectric);
    return s;
}

/// Those whose hits count move to the beginning.
[[gnu::always_inline]] inline size_t keepHits(MirrorLanes& m, size_t count) {
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
        if (!(m.share[i] > 0.0f)) continue;
        m.at[kept] = m.at[i];
        m.px[kept] = m.px[i];
        m.nx[kept] = m.nx[i];
        m.ny[kept] = m.ny[i];
        m.nz[kept] = m.nz[i];
        m.roughness[kept] = m.roughness[i];
        m.rx[kept] = m.rx[i];
        m.ry[kept] = m.ry[i];
        m.rz[kept] = m.rz[i];
        m.hitX[kept] = m.hitX[i];
        m.hitY[kept] = m.hitY[i];
        m.share[kept++] = m.share[i];
    }
    return kept;
}

bool reflectRow(const FrameConstants& frame, const ReflectionInput& in, uint32_t x0, uint32_t y, uint32_t n,
                const MirroredRow& out) {
    const FrameConstants f = frame;
    const size_t first = size_t{y} * f.width + x0;
    const float py = float(int(y)) + 0.5f - f.centre.y;
    MirrorLanes m;
    size_t count = takeMirrors(f, in, first, float(int(x0)) + 0.5f - f.centre.x, n, m);
    if (count == 0) return false;
    startRays(f, in.constants, py, count, m);
    uint32_t going = (1u << (count + kTexelGroup - 1) / kTexelGroup) - 1u, from = 1;
    for (uint32_t tries = 0; going != 0u && tries < kMirrorTries; ++tries) {
        followRays(f, in.depth, going, from, in.constants.steps, count, m);
        narrowSteps(f, in.depth, going, count, m);
        going = passBehind(f, in.depth, in.normal, going, count, m, from);
    }
    weighHits(f, in, py, count, m);
    count = keepHits(m, count);
    if (count == 0) return false;
    const Lens lens = lensHere(f.focal);
    for (size_t i = 0; i < count; ++i) {
        const Surface s = mirrorOf(in, lens, m, i, first + m.at[i], py);
        const vec3 around = mirrorSurroundings(in.light.environment, f, s, vec3(m.rx[i], m.ry[i], m.rz[i]));
        m.farR[i] = around.x;
        m.farG[i] = around.y;
        m.farB[i] = around.z;
        m.metR[i] = m.metG[i] = m.metB[i] = m.counted[i] = 0.0f;
    }
    const vec2 size(float(int(f.width)), float(int(f.height)));
    thread_local MetRow met{};
    for (uint32_t tap = 0; tap < 4; ++tap) {
        met.clear(in, n);
        for (size_t i = 0; i < count; ++i)
            m.counted[i] +=
                met.take(f, in, m.at[i], mirrorTap(size, m.hitX[i], m.hitY[i], tap), vec3(m.rx[i], m.ry[i], m.rz[i]));
        if (in.shadows.slots > 0) shadowRow(f, in.shadows, x0, y, n, met.row);
        lightRow(f, in.light, x0, y, n, met.row);
        for (size_t i = 0; i < count; ++i) {
            const uint32_t at = m.at[i];
            m.metR[i] += met.share[at] * (met.row.red[at] - m.farR[i]);
            m.metG[i] += met.share[at] * (met.row.green[at] - m.farG[i]);
            m.metB[i] += met.share[at] * (met.row.blue[at] - m.farB[i]);
        }
    }
    for (size_t i = 0; i < n; ++i) out.red[i] = out.green[i] = out.blue[i] = 0.0f;
    for (size_t i = 0; i < count; ++i) {
        const Surface s = mirrorOf(in, lens, m, i, first + m.at[i], py);
        const float share = m.share[i] / max(m.counted[i], kMirrorCounted);
        const vec3 added = mirrorAdded(s, vec3(share * m.metR[i], share * m.metG[i], share * m.metB[i]));
        out.red[m.at[i]] = added.x;
        out.green[m.at[i]] = added.y;
        out.blue[m.at[i]] = added.z;
    }
    return true;
}
