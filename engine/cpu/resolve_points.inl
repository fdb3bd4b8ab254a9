// From the visibility buffer to the texels of a row: points are gathered and become splats (or, where every pixel that
// a disc covers is its own, what the pixel shows); other kinds have files of their own. Included by kernels.inl.

/// The points of a row side by side, without the pixels between them.
struct Gathered {
    uint32_t count;
    uint32_t whole;                     // up to a whole group: behind the last point there is nothing
    alignas(64) uint32_t pixel[kTile];  // of each, from the row's first on
    RowBits of;                         // the same
    alignas(64) float x[kTile], y[kTile], z[kTile], radius[kTile];
    alignas(64) uint32_t normal[kTile], colour[kTile], flags[kTile];
    alignas(64) uint32_t material[kTile];  // only of frames with materials
    // Of turned instances: normals in camera space.
    alignas(64) float turned[kTile], nx[kTile], ny[kTile], nz[kTile];
    alignas(64) float front[kTile];  // depth by which each was the nearest
    uint8_t smooth[kTile];
    alignas(64) uint32_t positionXY[kTile], positionZ[kTile];  // of the records, which are read once
    alignas(64) const DrawNode* node[kTile];                   // null: of blended ones, and behind the last
};

/// What the points of a row are: flags and masks of all of them.
struct GatheredKinds {
    bool any = false;
    uint32_t flags = 0, octantMasks = 0;
    bool isTurned() const { return (octantMasks & kNodeTurned) != 0u; }
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
                                                 TexelRow& __restrict row) {
    const float focal = f.focal, support = f.supportScale, minimum = f.minimumRadius;
    const Lens lens = lensHere(focal);
    const float mostScattered = largestSplat(kFlagScattered, focal, f.height), most = largestSplat(0u, focal, f.height);
    const float centreX = f.centre.x - float(int(x0)) - 0.5f, centreY = f.centre.y - float(int(y)) - 0.5f;
#pragma GCC ivdep
    for (size_t i = 0; i < g.whole; ++i) {
        const bool valid = g.z[i] > 0.0f;
        const vec3 c = vec3(valid ? g.x[i] : 0.0f, valid ? g.y[i] : 0.0f, valid ? g.z[i] : 1.0f);
        const vec3 nc = gatheredNormal<anyTurned>(f, g, i, c);
        const float cap = (g.flags[i] & kFlagScattered) != 0u ? mostScattered : most;
        Texel t = texelFromSplat(c, nc, min(g.radius[i] * support, lensDepth(lens, c.z) * cap), lens, minimum);
        const float scale = focal / lensDepth(lens, c.z);
        // Nearly the pixel's own coordinate is taken off before adding, so that the offset keeps its low bits.
        t.offset = vec2(c.x * scale + centreX - float(int(g.pixel[i])), c.y * scale + centreY);
        t.depth = valid ? t.depth : 0.0f;
        t.radius = valid ? t.radius : 0.0f;
        t.thickness = (g.flags[i] & kFlagLeaf) != 0u ? kLeafThickness * t.radius : t.thickness;
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel<false, false>(row, kPad + i, t);
    }
}

/// The same where every pixel that a disc covers is its own: no splats, but what the pixels show. `hasPlaces`: places
/// have been gathered; else all have normals, and of their depths nobody asks more than whether there is one, or they
/// are blended of more than one disc. `isRounded`: as packed texels are.
template <bool anyTurned, bool hasPlaces, bool isRounded>
[[gnu::always_inline]] inline void resolveExact(const FrameConstants& f, const Gathered& g, uint32_t x0, uint32_t y,
                                                TexelRow& __restrict row) {
    const float focal = f.focal, support = f.supportScale,
                mostScattered = largestSplat(kFlagScattered, focal, f.height);
    const Lens lens = lensHere(focal);
    const float x = float(int(x0)) + 0.5f - f.centre.x, py = float(int(y)) + 0.5f - f.centre.y;
#pragma GCC ivdep
    for (size_t i = 0; i < g.whole; ++i) {
        const bool valid = g.front[i] > 0.0f;
        const bool isPlaced = hasPlaces & valid;
        const vec3 c = vec3(isPlaced ? g.x[i] : 0.0f, isPlaced ? g.y[i] : 0.0f, isPlaced ? g.z[i] : 1.0f);
        const vec3 nc = gatheredNormal<anyTurned>(f, g, i, c);
        const vec3 v = viewDirection(x + float(int(g.pixel[i])), py, lensHere(focal));
        const float flip = dot(nc, v) > 0.0f ? -1.0f : 1.0f;
        const vec2 perp = perpFromNormal(nc, v);
        Texel t;
        float depth = g.front[i];
        if (hasPlaces) {
            const float cap = (g.flags[i] & kFlagScattered) != 0u ? lensDepth(lens, c.z) * mostScattered : 3.0e38f;
            const float shown = shownDepth({c, nc, min(g.radius[i] * support, cap), 0u}, g.front[i]);
            depth = min(g.front[i], max(shown, 0.0f));
        }
        t.depth = valid ? depth : 0.0f;
        t.radius = valid ? kExactRadius : 0.0f;
        t.thickness = (g.flags[i] & kFlagLeaf) != 0u ? kLeafThickness * t.radius : t.radius;
        t.offset = vec2(0.0f, 0.0f);
        t.normalPerp = vec2(perp.x * flip, perp.y * flip);
        if (isRounded) t.normalPerp = unpackNormal(packNormal(t.normalPerp));
        t.colour = vec3(unpackRed(g.colour[i]), unpackGreen(g.colour[i]), unpackBlue(g.colour[i]));
        setTexel<false, false>(row, kPad + i, t);
    }
}

template <bool anyTurned>
void resolvePoints(const FrameConstants& f, const ResolveInput& in, const Gathered& g, bool hasPlaces, bool isRounded,
                   uint32_t x0, uint32_t y, TexelRow& row) {
    if (!in.exactPoints)
        resolveSplats<anyTurned>(f, g, x0, y, row);
    else if (hasPlaces && isRounded)
        resolveExact<anyTurned, true, true>(f, g, x0, y, row);
    else if (hasPlaces)
        resolveExact<anyTurned, true, false>(f, g, x0, y, row);
    else if (isRounded)
        resolveExact<anyTurned, false, true>(f, g, x0, y, row);
    else
        resolveExact<anyTurned, false, false>(f, g, x0, y, row);
    if (row.hasMaterials)
#pragma GCC ivdep
        for (size_t i = 0; i < g.whole; ++i) {
            const TexelSurface s = surfaceOfPoint(g.material[i]);
            row.share[kPad + i] = s.share;
            row.metallic[kPad + i] = s.metallic;
            row.roughness[kPad + i] = s.roughness;
        }
}

/// Texels in their places of a row; depths, radii and materials between them are 0.
void openUpRow(const ClosedUpRow& closedUp, uint32_t n, TexelRow& row) {
    constexpr size_t kPlanes = 13, kOfMaterials = 3, kOfNothing = 2;  // depth and radius first, materials last
    const auto planesOf = [](auto& r) {
        struct {
            decltype(&r.depth[0]) of[kPlanes];
        } p{{r.depth, r.radius, r.thickness, r.x, r.y, r.perpX, r.perpY, r.red, r.green, r.blue, r.share, r.metallic,
             r.roughness}};
        return p;
    };
    const auto from = planesOf(closedUp.texels);
    const auto to = planesOf(row);
    const size_t all = row.hasMaterials ? kPlanes : kPlanes - kOfMaterials;
    size_t before = kPad;
    for (uint32_t group = 0; group * kTexelGroup < n; ++group) {
        const uint32_t bits = closedUp.of.group(group);
        const OpenGroup open = openGroup(bits);
        const size_t at = kPad + size_t{group} * kTexelGroup;
        const size_t planes = bits != 0u || row.hasMaterials ? all : kOfNothing;
        for (size_t k = 0; k < planes; ++k) openUp(open, from.of[k] + before, to.of[k] + at);
        before += size_t(__builtin_popcount(bits));
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

/// There are no more than `count` points.
void endGathered(uint32_t count, Gathered& g) {
    g.count = count;
    g.whole = wholeGroups(count);
    for (size_t i = count; i < g.whole; ++i) {
        g.pixel[i] = 0;
        g.front[i] = g.radius[i] = g.turned[i] = 0;
        g.normal[i] = g.colour[i] = g.positionXY[i] = g.positionZ[i] = 0;
        g.flags[i] = kFlagNoNormal;
        g.material[i] = kPlainPoint;
        g.x[i] = g.y[i] = 0;
        g.z[i] = -1;
        g.nx[i] = g.ny[i] = g.nz[i] = 0;
        g.node[i] = nullptr;
    }
}

/// All of a point but where its place is in camera space (and of turned nodes its normal).
[[gnu::always_inline]] inline void gatherPoint(const FrameConstants& f, const Tables& tables, const BlockSource& block,
                                               uint64_t key, Gathered& g, size_t i, GatheredKinds& kinds) {
    const PointRecord* const r = block.records + keyLane(key);
    const DrawNode& node = *block.node;
    g.node[i] = &node;
    g.positionXY[i] = r->positionXY;
    g.positionZ[i] = r->positionZRadiusError;
    g.radius[i] = node.edge * tables.radiusFraction[recordRadiusCode(*r)];
    g.normal[i] = r->normal;
    g.flags[i] = recordFlags(*r);
    if (f.hasMaterials != 0u) g.material[i] = block.materialOf(keyLane(key));
    g.front[i] = keyDepth(key);
    g.turned[i] = (node.octantMask & kNodeTurned) != 0u ? 1.0f : 0.0f;
    g.smooth[i] = (node.octantMask & kNodeSmooth) != 0u ? 1 : 0;
    kinds.any = true;
    kinds.flags |= recordFlags(*r);
    kinds.octantMasks |= node.octantMask;
    const uint32_t c = r->colour;
    if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
        const vec3 d = f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
        g.colour[i] = packColour(d.x, d.y, d.z);
    } else {
        g.colour[i] = tables.red[c & 255u] | tables.green[c >> 8 & 255u] | tables.blue[c >> 16 & 255u];
    }
}

/// Place of a record of that node in camera space.
[[gnu::always_inline]] inline vec3 placeInNode(const DrawNode& node, uint32_t positionXY, uint32_t positionZ) {
    const PointRecord r{positionXY, positionZ, 0u, 0u};
    const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
    return vec3(node.base.x + node.axisX.x * qx + node.axisY.x * qy + node.axisZ.x * qz,
                node.base.y + node.axisX.y * qx + node.axisY.y * qy + node.axisZ.y * qz,
                node.base.z + node.axisX.z * qx + node.axisY.z * qy + node.axisZ.z * qz);
}
/// The same of those points of a group that are of the node: a bit each. `isFirst`: else others have places already.
template <bool isFirst>
[[gnu::always_inline]] inline void placesInNode(const DrawNode& drawNode, uint32_t isOf, size_t first,
                                                Gathered& __restrict g) {
    const DrawNode node = drawNode;
#pragma GCC unroll 1  // (of loops over so few GCC makes no SIMD once it has unrolled them)
#pragma GCC ivdep
    for (size_t i = 0; i < kTexelGroup; ++i) {
        const vec3 place = placeInNode(node, g.positionXY[first + i], g.positionZ[first + i]);
        const bool is = (isOf >> uint32_t(i) & 1u) != 0u;
        g.x[first + i] = is ? place.x : isFirst ? 0.0f : g.x[first + i];
        g.y[first + i] = is ? place.y : isFirst ? 0.0f : g.y[first + i];
        g.z[first + i] = is ? place.z : isFirst ? -1.0f : g.z[first + i];
    }
}
/// Places of the points of a row: of each few side by side one node after the other, which are mostly one or two.
void gatherPlaces(Gathered& g) {
    constexpr int kNodesTogether = 4;
    for (size_t first = 0; first < g.count; first += kTexelGroup) {
        uint32_t left = kWholeGroup & ~equalBits(g.node + first, nullptr);
        for (int nodes = 0; left != 0u; ++nodes) {
            if (nodes == kNodesTogether) {  // as of a forest from afar: one by one
                for (; left != 0u; left &= left - 1u) {
                    const size_t i = first + size_t(__builtin_ctz(left));
                    const vec3 place = placeInNode(*g.node[i], g.positionXY[i], g.positionZ[i]);
                    g.x[i] = place.x;
                    g.y[i] = place.y;
                    g.z[i] = place.z;
                }
                break;
            }
            const size_t of = first + size_t(__builtin_ctz(left));
            const uint32_t ofNode = equalBits(g.node + first, g.node[of]);
            left &= ~ofNode;
            if (nodes == 0)
                placesInNode<true>(*g.node[of], ofNode, first, g);
            else
                placesInNode<false>(*g.node[of], ofNode, first, g);
        }
    }
}

/// Points of turned nodes, closed up once more: their nodes' axes, and places among those gathered.
struct TurnedPoints {
    alignas(64) float axes[9][kTile];
    alignas(64) uint32_t normal[kTile], octantMask[kTile], at[kTile + 1];
    alignas(64) float nx[kTile], ny[kTile], nz[kTile];
};
/// Normals of turned nodes; of others they are left as they are, and not taken (gatheredNormal). Far away each pixel is
/// of another node.
void turnNormals(Gathered& g) {
    TurnedPoints t;
    uint32_t count = 0;
    for (uint32_t i = 0; i < g.count; ++i) {
        t.at[count] = i;
        count += g.turned[i] > 0.5f ? 1u : 0u;
    }
    for (uint32_t k = 0; k < count; ++k) {
        const DrawNode& node = *g.node[t.at[k]];
        const float* const axes = &node.axisX.x;
        for (size_t a = 0; a < 9; ++a) t.axes[a][k] = axes[a];
        t.octantMask[k] = node.octantMask;
        t.normal[k] = g.normal[t.at[k]];
    }
#pragma GCC ivdep
    for (size_t k = 0; k < count; ++k) {
        DrawNode node{};
        node.axisX = vec3(t.axes[0][k], t.axes[1][k], t.axes[2][k]);
        node.axisY = vec3(t.axes[3][k], t.axes[4][k], t.axes[5][k]);
        node.axisZ = vec3(t.axes[6][k], t.axes[7][k], t.axes[8][k]);
        node.octantMask = t.octantMask[k];
        const vec3 turned = nodeUnitNormal(node, octDecode(t.normal[k]));
        t.nx[k] = turned.x;
        t.ny[k] = turned.y;
        t.nz[k] = turned.z;
    }
    for (uint32_t k = 0; k < count; ++k) {
        g.nx[t.at[k]] = t.nx[k];
        g.ny[t.at[k]] = t.ny[k];
        g.nz[t.at[k]] = t.nz[k];
    }
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
[[gnu::always_inline]] inline void gatherBlended(const FilteredPixel& shown, uint64_t key, Gathered& g, size_t i,
                                                 GatheredKinds& kinds) {
    const vec3 d = octDecode(shown.normal);
    kinds.any = true;
    kinds.octantMasks |= kNodeTurned;
    g.node[i] = nullptr;
    g.smooth[i] = 0;
    g.front[i] = keyDepth(key);
    g.radius[i] = 0;
    g.normal[i] = 0;
    g.turned[i] = 1;
    g.nx[i] = d.x;
    g.ny[i] = d.y;
    g.nz[i] = d.z;
    g.flags[i] = (shown.cover & kFilteredLeaf) != 0 ? kFlagLeaf : 0u;
    g.colour[i] = shown.colour;
    g.material[i] = (shown.cover & kFilteredMaterial) != 0 ? shown.cover >> 16 : kPlainPoint;
}

/// Empties the row's entries of the visibility buffer. `filtered`: of the row, or null: its points are their records.
/// `seconds`: of the row; before some of its points other kinds are shown. `hasNext`: it is not the picture's last row.
void gatherRow(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, const FilteredPixel* filtered,
               const SecondPixels& seconds, uint64_t* visibility, bool hasNext, uint32_t n, Gathered& g,
               OtherPixels& others, GatheredKinds& kinds) {
    const BlockRanges firstBlock = f.firstBlock;
    // (The next row of the tile is a picture's width away, where no processor looks by itself.)
    for (uint32_t i = 0; hasNext && i < n; i += 8) __builtin_prefetch(visibility + f.width + i, 1);
    for (WinningPixels& p : others.of) p.count = 0;
    // The pixels that show something, closed up without branches.
    alignas(64) uint32_t seen[kTile + kTexelGroup];
    uint64_t keys[kTile];
    const BlockSource* of[kTile];  // null: no record
    uint32_t count = 0;
    const bool hasSeconds = seconds.list != nullptr;
    RowBits shown;
    for (uint32_t first = 0; first < n; first += kTexelGroup) {
        const uint32_t lanes = n - first < kTexelGroup ? n - first : kTexelGroup;
        uint32_t bits = shownBits(visibility + first, lanes);
        for (uint32_t i = 0; hasSeconds && i < lanes; ++i)
            bits |= (seconds.kinds[first + i] == kSecondFront ? 1u : 0u) << i;
        storeNumbers(bits, first, seen + count);
        count += uint32_t(__builtin_popcount(bits));
        shown.of[first / 64] |= uint64_t{bits} << first % 64;
    }
    // Blocks, their records and their nodes lie anywhere in memory: all of the row are asked for before any is read.
    for (uint32_t k = 0; k < count; ++k) {
        const uint32_t i = seen[k];
        const bool isSecond = hasSeconds && seconds.kinds[i] == kSecondFront;
        const uint64_t key = isSecond ? seconds.at(i)->key : visibility[i];
        visibility[i] = kNoKey;
        keys[k] = key;
        of[k] = filtered == nullptr && isPointKey(key, firstBlock) ? blocks + keyBlock(key) : nullptr;
        if (filtered == nullptr) __builtin_prefetch(of[k]);
    }
    for (uint32_t k = 0; filtered == nullptr && k < count; ++k) {
        if (of[k] == nullptr) continue;
        __builtin_prefetch(of[k]->records + keyLane(keys[k]));
        __builtin_prefetch(of[k]->node);
        __builtin_prefetch(reinterpret_cast<const char*>(of[k]->node) + 64);
    }
    uint32_t points = 0;
    for (uint32_t k = 0; k < count; ++k) {
        const uint32_t i = seen[k];
        const uint64_t key = keys[k];
        g.pixel[points] = i;
        if (of[k] != nullptr)
            gatherPoint(f, tables, *of[k], key, g, points++, kinds);
        else if (isPointKey(key, firstBlock))
            gatherBlended(filtered[i], key, g, points++, kinds);
        else if (key != kNoKey)
            gatherOther(key, firstBlock, i, others);
    }
    endGathered(points, g);
    if (points == count) g.of = shown;
    for (uint32_t k = 0; points < count && k < points; ++k) g.of.add(g.pixel[k]);
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

/// Texels of the points that were gathered, side by side.
void resolveGathered(const FrameConstants& f, const ResolveInput& in, const GatheredKinds& kinds, bool isRounded,
                     uint32_t x0, uint32_t y, Gathered& g, TexelRow& row, float& largestRadius) {
    const bool needsPlaces = in.filtered == nullptr && (!in.exactPoints || in.needsDepths ||
                                                        (kinds.flags & kFlagNoNormal) != 0u ||
                                                        (kinds.octantMasks & kNodeSmooth) != 0u);
    if (needsPlaces) gatherPlaces(g);
    if (in.filtered == nullptr && kinds.isTurned()) turnNormals(g);
    if (kinds.isTurned())
        resolvePoints<true>(f, in, g, needsPlaces, isRounded, x0, y, row);
    else
        resolvePoints<false>(f, in, g, needsPlaces, isRounded, x0, y, row);
    uint largest = 0;  // as bits: positive floats sort like integers
    for (size_t i = 0; i < g.whole; ++i) {
        const uint bits = floatBitsToUint(row.radius[kPad + i]);
        largest = bits > largest ? bits : largest;
    }
    largestRadius = max(largestRadius, uintBitsToFloat(largest));
}

/// The points of a row that has gaps. True if they are all that it shows, and `closedUp` is all of them.
bool resolveGaps(const FrameConstants& f, const ResolveInput& in, const GatheredKinds& kinds, bool hasOthers,
                 uint32_t x0, uint32_t y, uint32_t n, Gathered& g, TexelRow& row, ClosedUpRow& closedUp,
                 float& largestRadius) {
    TexelRow& texels = closedUp.texels;
    texels.hasTubes = false;
    texels.hasMaterials = row.hasMaterials;
    resolveGathered(f, in, kinds, row.isRounded, x0, y, g, texels, largestRadius);
    closedUp.of = g.of;
    openUpRow(closedUp, n, row);
    int isMissed = 0;  // (of those that are nothing after all no group may be left out)
    for (size_t k = 0; k < g.count; ++k) isMissed |= aboveZero(texels.depth[kPad + k]) == 0 ? 1 : 0;
    return !hasOthers && isMissed == 0;
}

bool resolveRow(const FrameConstants& frame, const Tables& tables, const ResolveInput& in, uint64_t* visibility,
                uint32_t x0, uint32_t y, uint32_t n, TexelRow& __restrict row, ClosedUpRow& closedUp,
                float& largestRadius, const SurfacePlanes& planes) {
    uint32_t* const surface = planes.surface;
    const FrameConstants f = frame;
    Gathered g;
    OtherPixels others;
    GatheredKinds kinds;
    const FilteredPixel* const filtered = in.filtered != nullptr ? in.filtered + size_t{y} * f.width + x0 : nullptr;
    const size_t first = size_t{y} * f.width + x0;
    SecondPixels seconds = in.seconds;
    if (!seconds.mayHave(first, n)) seconds.list = nullptr;
    if (seconds.list != nullptr) {
        seconds.kinds += first;
        seconds.places += first;
    }
    gatherRow(f, tables, in.blocks, filtered, seconds, visibility, y + 1 < f.height, n, g, others, kinds);
    closedUp.of = {};
    if (surface != nullptr)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) surface[i] = 0;
    if (planes.smooth != nullptr) {
        for (size_t i = 0; i < n; ++i) planes.smooth[i] = 0;
        for (size_t k = 0; k < g.count; ++k) planes.smooth[g.pixel[k]] = g.smooth[k];
    }
    row.isRounded = in.roundsPoints && kinds.any && !others.any() && !row.hasMaterials;
    if (!kinds.any) {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) row.depth[kPad + i] = 0;
        if (row.hasMaterials)
            for (size_t i = 0; i < n; ++i)
                row.share[kPad + i] = row.metallic[kPad + i] = row.roughness[kPad + i] = 0.0f;
        resolveOthers(f, tables, in, others, x0, y, n, row, largestRadius, planes);
        return others.any();
    }
    if (g.count == n)
        resolveGathered(f, in, kinds, row.isRounded, x0, y, g, row, largestRadius);
    else if (!resolveGaps(f, in, kinds, others.any(), x0, y, n, g, row, closedUp, largestRadius))
        closedUp.of = {};
    resolveOthers(f, tables, in, others, x0, y, n, row, largestRadius, planes);
    return true;
}

/// (Colours alone: what a pixel's disc looks like otherwise matters to nobody there.)
RowContent showPoints(const FrameConstants& f, const Tables& tables, const BlockSource* blocks, bool tellsSmooth,
                      uint64_t* visibility, uint32_t n, uint32_t nothing, uint32_t* __restrict rgba) {
    const uint64_t end = drawId(f.firstBlock.of[kKindPoints + 1u], 0u);
    alignas(64) uint32_t at[kTile];
    const PointRecord* from[kTile];
    uint32_t count = 0, others = 0;
    for (uint32_t i = 0; i < n; ++i) {
        const uint64_t key = visibility[i];
        at[count] = i;
        count += key != kNoKey ? 1u : 0u;
        others |= (key != kNoKey) & ((key & kDrawIdMask) >= end) ? 1u : 0u;
    }
    if (others != 0u) return RowContent::other;
    if (count == 0u) return RowContent::nothing;
    uint64_t lastPlace = kNoKey;
    uint32_t smooth = 0;
    const PointRecord* last = nullptr;
    for (uint32_t k = 0; k < count; ++k) {
        const uint64_t place = visibility[at[k]] & kDrawIdMask;
        if (place != lastPlace) {
            const BlockSource& block = blocks[keyBlock(place)];
            last = block.records + keyLane(place);
            __builtin_prefetch(last);
            smooth |= block.node->octantMask;
        }
        lastPlace = place;
        from[k] = last;
    }
    if (tellsSmooth && (smooth & kNodeSmooth) != 0u) return RowContent::other;
    for (uint32_t i = 0; i < n; ++i) rgba[i] = nothing;
    for (uint32_t k = 0; k < count; ++k) {
        const uint32_t c = from[k]->colour;
        rgba[at[k]] = tables.shownRed[c & 255u] | tables.shownGreen[c >> 8 & 255u] | tables.shownBlue[c >> 16 & 255u];
        visibility[at[k]] = kNoKey;
    }
    return RowContent::points;
}
