// From the visibility buffer to the texels of a row: points are gathered and become splats (or, where every pixel that
// a disc covers is its own, what the pixel shows); other kinds have files of their own. Included by kernels.inl.

struct Gathered {
    alignas(64) float x[kTile], y[kTile], z[kTile], radius[kTile];
    alignas(64) uint32_t normal[kTile], colour[kTile], flags[kTile];
    alignas(64) uint32_t material[kTile];  // only of frames with materials
    // Of turned instances: normals in camera space.
    alignas(64) float turned[kTile], nx[kTile], ny[kTile], nz[kTile];
    alignas(64) float front[kTile];  // depth by which each was the nearest
    alignas(64) uint8_t smooth[kTile];
};

/// Camera-space normals of the points that were gathered, any side. `anyTurned`: of instances that are not turned the
/// frame's own rotation is all that normals need.
template <bool anyTurned>
[[gnu::always_inline]] inline vec3 gatheredNormal(const FrameConstants& f, const Gathered& g, size_t i, vec3 c) {
    const vec3 d = octDecode(g.normal[i]);
    const bool hasNormal = (g.flags[i] & kFlagNoNormal) == 0u;
    vec3 n =
        vec3(f.viewX.x * d.x + f.viewX.y * d.y + f.viewX.z * d.z, f.viewY.x * d.x + f.viewY.y * d.y + f.viewY.z * d.z,
             f.viewZ.x * d.x + f.viewZ.y * d.y + f.viewZ.z * d.z);
    if (anyTurned) {
        const bool isTurned = g.turned[i] > 0.5f;
        n.x = isTurned ? g.nx[i] : n.x;
        n.y = isTurned ? g.ny[i] : n.y;
        n.z = isTurned ? g.nz[i] : n.z;
    }
    const vec3 sight = sightTo(lensHere(f.focal), c);
    const float inverse = 1.0f / std::sqrt(sight.x * sight.x + sight.y * sight.y + sight.z * sight.z);
    n.x = hasNormal ? n.x : -sight.x * inverse;
    n.y = hasNormal ? n.y : -sight.y * inverse;
    n.z = hasNormal ? n.z : -sight.z * inverse;
    return n;
}

/// Texels of the points that were gathered.
template <bool anyTurned>
[[gnu::always_inline]] inline void resolveSplats(const FrameConstants& f, const Gathered& g, uint32_t x0, uint32_t y,
                                                 uint32_t n, TexelRow& __restrict row) {
    const float focal = f.focal, support = f.supportScale, minimum = f.minimumRadius;
    const Lens lens = lensHere(focal);
    const float mostScattered = largestSplat(kFlagScattered, focal, f.height), most = largestSplat(0u, focal, f.height);
    const float centreX = f.centre.x - float(int(x0)) - 0.5f, centreY = f.centre.y - float(int(y)) - 0.5f;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const bool valid = g.z[i] > 0.0f;
        const vec3 c = vec3(valid ? g.x[i] : 0.0f, valid ? g.y[i] : 0.0f, valid ? g.z[i] : 1.0f);
        const vec3 nc = gatheredNormal<anyTurned>(f, g, i, c);
        const float cap = (g.flags[i] & kFlagScattered) != 0u ? mostScattered : most;
        Texel t = texelFromSplat(c, nc, min(g.radius[i] * support, lensDepth(lens, c.z) * cap), lens, minimum);
        const float scale = focal / lensDepth(lens, c.z);
        // Nearly the pixel's own coordinate is taken off before adding, so that the offset keeps its low bits.
        t.offset = vec2(c.x * scale + centreX - float(int(i)), c.y * scale + centreY);
        t.depth = valid ? t.depth : 0.0f;
        t.radius = valid ? t.radius : 0.0f;
        t.thickness = (g.flags[i] & kFlagLeaf) != 0u ? kLeafThickness * t.radius : t.thickness;
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel<false, false>(row, kPad + i, t);
    }
}

/// The same where every pixel that a disc covers is its own: no splats, but what the pixels show. `isBlended`: of more
/// than one disc.
template <bool anyTurned>
[[gnu::always_inline]] inline void resolveExact(const FrameConstants& f, const Gathered& g, bool isBlended, uint32_t x0,
                                                uint32_t y, uint32_t n, TexelRow& __restrict row) {
    const float focal = f.focal, support = f.supportScale,
                mostScattered = largestSplat(kFlagScattered, focal, f.height), anywhere = isBlended ? 3.0e38f : 0.0f;
    const Lens lens = lensHere(focal);
    const float x = float(int(x0)) + 0.5f - f.centre.x, py = float(int(y)) + 0.5f - f.centre.y;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const bool valid = g.front[i] > 0.0f;
        const vec3 c = vec3(valid ? g.x[i] : 0.0f, valid ? g.y[i] : 0.0f, valid ? g.z[i] : 1.0f);
        const vec3 nc = gatheredNormal<anyTurned>(f, g, i, c);
        const vec3 v = viewDirection(x + float(int(i)), py, lensHere(focal));
        const float flip = dot(nc, v) > 0.0f ? -1.0f : 1.0f;
        const vec2 perp = perpFromNormal(nc, v);
        Texel t;
        const float cap = (g.flags[i] & kFlagScattered) != 0u ? lensDepth(lens, c.z) * mostScattered : 3.0e38f;
        const float shown = shownDepth({c, nc, min(g.radius[i] * support, cap), 0u}, g.front[i]);
        t.depth = valid ? min(g.front[i], max(shown, anywhere)) : 0.0f;
        t.radius = valid ? kExactRadius : 0.0f;
        t.thickness = (g.flags[i] & kFlagLeaf) != 0u ? kLeafThickness * t.radius : t.radius;
        t.offset = vec2(0.0f, 0.0f);
        t.normalPerp = vec2(perp.x * flip, perp.y * flip);
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel<false, false>(row, kPad + i, t);
    }
}

template <bool anyTurned>
void resolvePoints(const FrameConstants& f, const ResolveInput& in, const Gathered& g, uint32_t x0, uint32_t y,
                   uint32_t n, TexelRow& row) {
    if (in.exactPoints)
        resolveExact<anyTurned>(f, g, in.filtered != nullptr, x0, y, n, row);
    else
        resolveSplats<anyTurned>(f, g, x0, y, n, row);
    if (row.hasMaterials)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const TexelSurface s = surfaceOfPoint(g.material[i]);
            row.share[kPad + i] = s.share;
            row.metallic[kPad + i] = s.metallic;
            row.roughness[kPad + i] = s.roughness;
        }
}

/// The pixels of a row that show other kinds than points.
struct OtherPixels {
    WinningPixels of[kKindNothing];  // by kind; none of points
    bool any() const {
        uint32_t sum = 0;
        for (const WinningPixels& p : of) sum += p.count;
        return sum > 0;
    }
};

/// A pixel that shows no point.
[[gnu::always_inline]] inline void gatherNothing(Gathered& g, size_t i) {
    g.x[i] = 0;
    g.y[i] = 0;
    g.z[i] = -1;
    g.front[i] = 0;
    g.radius[i] = 0;
    g.normal[i] = 0;
    g.colour[i] = 0;
    g.flags[i] = kFlagNoNormal;
    g.material[i] = kPlainPoint;
    g.turned[i] = 0;
    g.smooth[i] = 0;
}

/// True if it is of a node that is turned.
[[gnu::always_inline]] inline bool gatherPoint(const FrameConstants& f, const Tables& tables, const BlockSource& block,
                                               uint64_t key, Gathered& g, size_t i) {
    const PointRecord r = block.records[keyLane(key)];
    const DrawNode& node = *block.node;
    const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
    g.x[i] = node.base.x + node.axisX.x * qx + node.axisY.x * qy + node.axisZ.x * qz;
    g.y[i] = node.base.y + node.axisX.y * qx + node.axisY.y * qy + node.axisZ.y * qz;
    g.z[i] = node.base.z + node.axisX.z * qx + node.axisY.z * qy + node.axisZ.z * qz;
    g.radius[i] = node.edge * tables.radiusFraction[recordRadiusCode(r)];
    g.normal[i] = r.normal;
    g.flags[i] = recordFlags(r);
    if (f.hasMaterials != 0u) g.material[i] = block.materialOf(keyLane(key));
    g.front[i] = keyDepth(key);
    g.turned[i] = 0;
    g.smooth[i] = (node.octantMask & kNodeSmooth) != 0u ? 1 : 0;
    const bool isTurned = (node.octantMask & kNodeTurned) != 0;
    if (isTurned) {
        const vec3 d = nodeUnitNormal(node, octDecode(r.normal));
        g.turned[i] = 1;
        g.nx[i] = d.x;
        g.ny[i] = d.y;
        g.nz[i] = d.z;
    }
    const uint32_t c = r.colour;
    if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
        const vec3 d = f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
        g.colour[i] = packColour(d.x, d.y, d.z);
    } else {
        g.colour[i] = tables.red[c & 255u] | tables.green[c >> 8 & 255u] | tables.blue[c >> 16 & 255u];
    }
    return isTurned;
}

[[gnu::always_inline]] inline void gatherOther(uint64_t key, const BlockRanges& firstBlock, size_t i,
                                               OtherPixels& others) {
    const uint32_t kind = keyKind(key, firstBlock);
    WinningPixels& to = others.of[kind];
    to.pixel[to.count] = static_cast<uint32_t>(i);
    to.id[to.count] = keyPlace(key, firstBlock.of[kind]);
    to.depth[to.count++] = keyDepth(key);
}

/// What a pixel's points were blended to.
[[gnu::always_inline]] inline void gatherBlended(const FilteredPixel& shown, uint64_t key, Gathered& g, size_t i) {
    const vec3 d = octDecode(shown.normal);
    g.x[i] = g.y[i] = 0;
    g.z[i] = 1;
    g.smooth[i] = 0;
    g.front[i] = keyDepth(key);
    g.turned[i] = 1;
    g.nx[i] = d.x;
    g.ny[i] = d.y;
    g.nz[i] = d.z;
    g.radius[i] = 0;
    g.flags[i] = (shown.cover & kFilteredLeaf) != 0 ? kFlagLeaf : 0u;
    g.colour[i] = shown.colour;
    g.material[i] = (shown.cover & kFilteredMaterial) != 0 ? shown.cover >> 16 : kPlainPoint;
}

/// Empties the row's entries of the visibility buffer. `filtered`: of the row, or null: its points are their records.
/// `seconds`: of the row; before some of its points other kinds are shown.
void gatherRow(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const FilteredPixel* filtered,
               const SecondPixels& seconds, uint64_t* visibility, uint32_t n, Gathered& g, OtherPixels& others,
               bool& any, bool& anyTurned) {
    constexpr size_t kPrefetch = 12;  // pixels ahead: records lie anywhere in memory
    const BlockRanges firstBlock = f.firstBlock;
    for (WinningPixels& p : others.of) p.count = 0;
    anyTurned = filtered != nullptr;
    for (size_t i = 0; i < n; ++i) {
        if (filtered == nullptr && i + kPrefetch < n && isPointKey(visibility[i + kPrefetch], firstBlock)) {
            const uint64_t ahead = visibility[i + kPrefetch];
            __builtin_prefetch(blocks[keyBlock(ahead)].records + keyLane(ahead));
        }
        uint64_t key = visibility[i];
        if (key != kNoKey) visibility[i] = kNoKey;
        if (seconds.list != nullptr && seconds.kinds[i] == kSecondFront) key = seconds.at(i)->key;
        if (isPointKey(key, firstBlock)) {
            any = true;
            if (filtered != nullptr)
                gatherBlended(filtered[i], key, g, i);
            else
                anyTurned = gatherPoint(f, tables, blocks[keyBlock(key)], key, g, i) || anyTurned;
            continue;
        }
        if (key != kNoKey) gatherOther(key, firstBlock, i, others);
        gatherNothing(g, i);
    }
}

/// Texels of what is not points; tubes of the row are none before.
void resolveOthers(const FrameConstants& f, const Tables& tables, const ResolveInput& in, const OtherPixels& others,
                   uint32_t x0, uint32_t y, uint32_t n, TexelRow& __restrict row, float& largestRadius,
                   const SurfacePlanes& planes) {
    if (row.hasTubes)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) row.isRound[kPad + i] = row.axisX[kPad + i] = 0;
    const WinningPixels &discs = others.of[kKindDiscs], &triangles = others.of[kKindTriangles],
                        &curves = others.of[kKindCurves], &patches = others.of[kKindPatches];
    if (discs.count > 0) resolveDiscs(f, tables, in, discs, x0, y, row);
    if (triangles.count > 0) resolveTriangles(f, in, triangles, x0, y, row, planes);
    if (patches.count > 0) resolvePatches(f, in, patches, x0, y, row, planes);
    for (uint32_t k = 0; k < kKindNothing; ++k)
        if (others.of[k].count > 0 && in.ofKind[k] != nullptr) in.ofKind[k](*in.frame, others.of[k], x0, y, row);
    row.hasTubes = curves.count > 0 && resolveCurves(f, in, curves, x0, y, row, largestRadius);
}

bool resolveRow(const FrameConstants& frame, const Tables& tables, const ResolveInput& in, uint64_t* visibility,
                uint32_t x0, uint32_t y, uint32_t n, TexelRow& __restrict row, float& largestRadius,
                const SurfacePlanes& planes) {
    uint32_t* const surface = planes.surface;
    const FrameConstants f = frame;
    Gathered g;
    OtherPixels others;
    bool any = false, anyTurned = false;
    const FilteredPixel* const filtered = in.filtered != nullptr ? in.filtered + size_t{y} * f.width + x0 : nullptr;
    const size_t first = size_t{y} * f.width + x0;
    SecondPixels seconds = in.seconds;
    if (!seconds.mayHave(first, n)) seconds.list = nullptr;
    if (seconds.list != nullptr) {
        seconds.kinds += first;
        seconds.places += first;
    }
    gatherRow(f, tables, in.blocks, filtered, seconds, visibility, n, g, others, any, anyTurned);
    if (surface != nullptr)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) surface[i] = 0;
    for (size_t i = 0; planes.smooth != nullptr && i < n; ++i) planes.smooth[i] = g.smooth[i];
    if (!any) {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) row.depth[kPad + i] = 0;
        if (row.hasMaterials)
            for (size_t i = 0; i < n; ++i)
                row.share[kPad + i] = row.metallic[kPad + i] = row.roughness[kPad + i] = 0.0f;
        resolveOthers(f, tables, in, others, x0, y, n, row, largestRadius, planes);
        return others.any();
    }
    if (anyTurned)
        resolvePoints<true>(f, in, g, x0, y, n, row);
    else
        resolvePoints<false>(f, in, g, x0, y, n, row);
    uint largest = 0;  // as bits: positive floats sort like integers
    for (size_t i = 0; i < n; ++i) {
        const uint bits = floatBitsToUint(row.radius[kPad + i]);
        largest = bits > largest ? bits : largest;
    }
    largestRadius = max(largestRadius, uintBitsToFloat(largest));
    resolveOthers(f, tables, in, others, x0, y, n, row, largestRadius, planes);
    return true;
}
