// Discs blended by their kernels (shaders/shared/ewa.h). Included by kernels.inl, once per instruction set, after
// splat.inl.
//
// Of a tile first the fronts: each pixel's nearest disc, moved back by what its surface may be rough; then the sums of
// all that lies before that. A disc weighs nothing from kernelSupport sigmas on, but is opaque up to kOpaqueSigmas.

/// What lies in front at each pixel of a tile, and what is in `front` of it counts.
struct TileFilter {
    static constexpr size_t kPixels = TileFront::kPixels;
    TileFront front;                                     ///< depths moved back
    alignas(64) float exact[kPixels];                    ///< depth of other kinds; kNoDisc: none
    alignas(64) float along[kPixels];                    ///< depth per length along the ray
    alignas(64) float own[kPixels];                      ///< depth of the front disc
    alignas(64) uint32_t rim[kPixels];                   ///< the first disc that counts there, or kOther
    alignas(64) float weight[kPixels], linear[kPixels];  ///< sums; linear: imageLinear of depths
    alignas(64) float red[kPixels], green[kPixels], blue[kPixels], nx[kPixels], ny[kPixels], nz[kPixels];
    alignas(64) uint32_t behind[kPixels];  ///< 1: something is opaque behind the front
};

/// Some discs of a tile, with their kernels.
struct FilterBatch {
    static constexpr size_t kSize = SplatBatch::kSize;
    alignas(64) float radius[kSize], sigma2[kSize];
    alignas(64) float x[kSize], y[kSize], alongX[kSize], skew[kSize], alongY[kSize], amplitude[kSize], halfX[kSize],
        halfY[kSize], isNear[kSize], nearest[kSize], farthest[kSize], overAhead[kSize];
    alignas(64) float red[kSize], green[kSize], blue[kSize], towards[kSize];
    alignas(64) uint32_t colour[kSize];
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

void prepareKernels(const FrameConstants& frame, const Tables& tables, const BlockSource* blocks,
                    const PlacedSplat* splats, const uint32_t* colours, const uint32_t* places, size_t count,
                    const SplatBatch& s, FilterBatch& __restrict b) {
    const FrameConstants f = frame;
    const float support = f.kernelSupport, lowPass = f.lowPass;
    const Lens lens = lensHere(f.focal);
    for (size_t i = 0; i < count; ++i) {
        const PlacedSplat& p = splats[places[i]];
        b.radius[i] = p.radius;
        b.colour[i] = colourOf(f, tables, blocks, p.id, colours[places[i]]);
    }
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const WideDisc d{vec3(s.cx[i], s.cy[i], s.cz[i]), vec3(s.nx[i], s.ny[i], s.nz[i]), b.radius[i], 0u};
        const float sigma = b.radius[i] * (1.0f / kOpaqueSigmas);
        const EwaKernel k = ewaKernel(d, sigma, support, lowPass, lens);
        b.sigma2[i] = 1.0f / (sigma * sigma);
        b.x[i] = k.x;
        b.y[i] = k.y;
        b.alongX[i] = k.alongX;
        b.skew[i] = k.skew;
        b.alongY[i] = k.alongY;
        b.amplitude[i] = k.amplitude;
        b.halfX[i] = k.halfX;
        b.halfY[i] = k.halfY;
        b.isNear[i] = k.isNear;
        const DepthRange range = depthRange(d, sigma, support, lowPass, lens);
        b.nearest[i] = range.nearest;
        b.farthest[i] = range.farthest;
        b.overAhead[i] = 1.0f / (abs(s.ahead[i]) > 1.0e-30f ? s.ahead[i] : 1.0e-30f);
        b.red[i] = unpackRed(b.colour[i]);
        b.green[i] = unpackGreen(b.colour[i]);
        b.blue[i] = unpackBlue(b.colour[i]);
        b.towards[i] = dot(d.normal, sightTo(lens, d.centre)) > 0.0f ? -1.0f : 1.0f;
    }
}

/// The pixels of a tile that may lie between two places, px from the principal point. `first`: the tile's.
struct TilePixels {
    int first, last;
};
[[gnu::always_inline]] inline TilePixels tilePixels(float from, float to, float centre, uint32_t first, uint32_t size) {
    const float shift = centre - 0.5f - float(int(first)), most = float(int(size)) - 1.0f;
    // A hundredth is for rounding.
    return {int(std::ceil(min(max(from + shift - 0.01f, 0.0f), most + 1.0f))),
            int(std::floor(min(max(to + shift + 0.01f, -1.0f), most)))};
}

/// The front of each pixel: of the opaque parts of discs, moved back by `shift` along the ray.
void drawFront(const SplatBatch& b, size_t i, float shift, uint32_t id, const SplatTile& tile, const FrameConstants& f,
               TileFilter& __restrict t) {
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const vec3 centre(b.cx[i], b.cy[i], b.cz[i]), normal(b.nx[i], b.ny[i], b.nz[i]);
    const float ahead = b.ahead[i], radius2 = b.radius2[i];
    const float shiftX = float(int(tile.x0)) + 0.5f - f.centre.x, shiftY = float(int(tile.y0)) + 0.5f - f.centre.y;
    const int x1 = b.lastX[i] < int(tile.width) ? b.lastX[i] : int(tile.width) - 1;
    const int x0 = firstLane(b.firstX[i], x1);
    const int y0 = b.firstY[i] > 0 ? b.firstY[i] : 0;
    const int y1 = b.lastY[i] < int(tile.height) ? b.lastY[i] : int(tile.height) - 1;
    for (int y = y0; y <= y1; ++y) {
        const float ey = (float(y) + shiftY) * inverseFocal;
        const float rest = normal.y * ey + normal.z;
        for (int x = x0; x <= x1; x += kSplatLanes) {
            const int at = y * int(SplatTile::kWidth) + x;
            uint32_t* const depth = t.front.depth + at;
            uint32_t* const owner = t.front.id + at;
            float* const own = t.own + at;
            const float* const along = t.along + at;
#pragma GCC ivdep
            for (int l = 0; l < kSplatLanes; ++l) {
                const float ex = (float(x + l) + shiftX) * inverseFocal;
                const SplatHit hit = splatHit(centre, normal, ahead, rest, ex, ey);
                const bool isHit = (hit.off2 <= radius2) & (hit.depth > nearPlane);
                const uint32_t bits = floatBitsToUint(hit.depth + shift * along[l]);
                const bool isFront = isHit & ((bits < depth[l]) | ((bits == depth[l]) & (id < owner[l])));
                depth[l] = isFront ? bits : depth[l];
                owner[l] = isFront ? id : owner[l];
                own[l] = isFront ? hit.depth : own[l];
            }
        }
    }
    if (b.missed[i] < 0) return;
    // The pixel of the centre, though its ray misses the disc: the plane's depth, so that the surface agrees with it.
    const auto at = size_t(b.missed[i]);
    const WideDisc d{centre, normal, std::sqrt(radius2), 0u};
    const Lens lens = lensHere(f.focal);
    const DepthRange range = depthRange(d, d.radius * (1.0f / kOpaqueSigmas), f.kernelSupport, f.lowPass, lens);
    const float ex = (float(int(at % SplatTile::kWidth)) + shiftX) * inverseFocal,
                ey = (float(int(at / SplatTile::kWidth)) + shiftY) * inverseFocal;
    const PixelRay ray = pixelRay(lens, ex, ey);
    const float depth = depthWithin(range, dot(normal, fromRay(ray, centre)), dot(normal, rayDirection(ray)));
    const uint32_t bits = floatBitsToUint(depth + shift * t.along[at]);
    if (bits > t.front.depth[at] || (bits == t.front.depth[at] && id >= t.front.id[at])) return;
    t.front.depth[at] = bits;
    t.front.id[at] = id;
    t.own[at] = depth;
}

/// Adds a disc to what is in front of the fronts. `isNear`: the disc is not wholly before the eye.
template <bool isNear>
void addKernel(const SplatBatch& b, const FilterBatch& k, size_t i, uint32_t id, const SplatTile& tile,
               const FrameConstants& f, float end, TileFilter& __restrict t) {
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const vec3 centre(b.cx[i], b.cy[i], b.cz[i]), normal(b.nx[i], b.ny[i], b.nz[i]);
    const float ahead = b.ahead[i], radius2 = b.radius2[i], support2 = f.kernelSupport * f.kernelSupport;
    const TilePixels columns = tilePixels(isNear ? -1.0e9f : k.x[i] - k.halfX[i], isNear ? 1.0e9f : k.x[i] + k.halfX[i],
                                          f.centre.x, tile.x0, tile.width);
    const TilePixels rows = tilePixels(isNear ? -1.0e9f : k.y[i] - k.halfY[i], isNear ? 1.0e9f : k.y[i] + k.halfY[i],
                                       f.centre.y, tile.y0, tile.height);
    const int x0 = firstLane(columns.first, columns.last);
    const float shiftX = float(int(tile.x0)) + 0.5f - f.centre.x, shiftY = float(int(tile.y0)) + 0.5f - f.centre.y;
    const float amplitude = k.amplitude[i], scale = amplitude / (1.0f - end);
    const float kx = k.x[i], ky = k.y[i], alongX = k.alongX[i], skew = k.skew[i], alongY = k.alongY[i],
                sigma2 = k.sigma2[i], overAhead = k.overAhead[i];
    const float nearest = k.nearest[i], farthest = k.farthest[i];
    const float least = kOrthographic ? nearest : 1.0f / farthest, most = kOrthographic ? farthest : 1.0f / nearest;
    const float red = k.red[i], green = k.green[i], blue = k.blue[i], nx = normal.x * k.towards[i],
                ny = normal.y * k.towards[i], nz = normal.z * k.towards[i];
    for (int y = rows.first; y <= rows.last; ++y) {
        const float py = float(y) + shiftY, ey = py * inverseFocal;
        const float rest = normal.y * ey + normal.z;
        for (int x = x0; x <= columns.last; x += kSplatLanes) {
            const int at = y * int(SplatTile::kWidth) + x;
            const uint32_t* const front = t.front.depth + at;
            float *const sumW = t.weight + at, *const sumLinear = t.linear + at, *const sumR = t.red + at,
                         *const sumG = t.green + at, *const sumB = t.blue + at, *const sumX = t.nx + at,
                         *const sumY = t.ny + at, *const sumZ = t.nz + at;
            uint32_t *const behind = t.behind + at, *const rim = t.rim + at;
#pragma GCC ivdep
            for (int l = 0; l < kSplatLanes; ++l) {
                const float px = float(x + l) + shiftX, ex = px * inverseFocal;
                const float dx = px - kx, dy = py - ky - skew * dx;
                const float farRho2 = dx * dx * alongX + dy * dy * alongY;
                // Its plane, no farther than the disc's rim; beyond its horizon it is as far as it gets.
                const float flat_ = (normal.x * ex + rest) * overAhead;
                const float plane = kOrthographic ? splatHit(centre, normal, ahead, rest, ex, ey).depth : 1.0f / flat_;
                const float depth = min(max(kOrthographic | (flat_ > 0.0f) ? plane : farthest, nearest), farthest);
                const float linear = min(max(kOrthographic ? plane : flat_, least), most);
                const float ox = kOrthographic ? centre.x - ex : plane * ex - centre.x,
                            oy = kOrthographic ? centre.y - ey : plane * ey - centre.y, oz = plane - centre.z;
                const float off2 = plane > nearPlane ? ox * ox + oy * oy + oz * oz : kNoDisc;
                const float rho2 = isNear ? off2 * sigma2 : farRho2;
                const bool isFront = depth <= uintBitsToFloat(front[l]);
                const bool isThere = (rho2 < support2) & isFront & (linear == linear);
                const float w = isThere ? max(gaussian(rho2) - end, 0.0f) * scale : 0.0f;
                sumW[l] += w;
                sumLinear[l] += isThere ? w * linear : 0.0f;
                sumR[l] += w * red;
                sumG[l] += w * green;
                sumB[l] += w * blue;
                sumX[l] += w * nx;
                sumY[l] += w * ny;
                sumZ[l] += w * nz;
                behind[l] = !isFront & (off2 <= radius2) ? 1u : behind[l];
                const uint32_t mine = w > 0.0f ? id : TileFront::kOther;
                rim[l] = mine < rim[l] ? mine : rim[l];
            }
        }
    }
}

void beginFilter(const FrameConstants& f, const SplatTile& tile, const Visibility& visibility,
                 TileFilter& __restrict t) {
    const float inverseFocal = 1.0f / f.focal;
    const float shiftX = float(int(tile.x0)) + 0.5f - f.centre.x, shiftY = float(int(tile.y0)) + 0.5f - f.centre.y;
    for (size_t i = 0; i < TileFilter::kPixels; ++i) {
        t.front.depth[i] = floatBitsToUint(kNoDisc);
        t.front.id[i] = t.rim[i] = TileFront::kOther;
        t.exact[i] = t.own[i] = kNoDisc;
        t.weight[i] = t.linear[i] = t.red[i] = t.green[i] = t.blue[i] = t.nx[i] = t.ny[i] = t.nz[i] = 0.0f;
        t.behind[i] = 0u;
        const float ex = (float(int(i % SplatTile::kWidth)) + shiftX) * inverseFocal,
                    ey = (float(int(i / SplatTile::kWidth)) + shiftY) * inverseFocal;
        t.along[i] = kOrthographic ? 1.0f : 1.0f / std::sqrt(ex * ex + ey * ey + 1.0f);
    }
    for (size_t y = 0; y < tile.height; ++y) {
        const uint64_t* const keys = visibility.keys + (tile.y0 + y) * f.width + tile.x0;
        for (size_t x = 0; x < tile.width; ++x)
            if (keys[x] != kNoKey) t.exact[y * SplatTile::kWidth + x] = keyDepth(keys[x]);
    }
}

/// What a pixel shows of what was added up there; nothing where it is less than half a code of coverage.
struct Filtered {
    bool isThere;
    uint64_t key;
    FilteredPixel pixel;
};
[[gnu::always_inline]] inline Filtered filteredPixel(const FrameConstants& f, const Tables& tables,
                                                     const BlockSource* blocks, const TileFilter& t, size_t i,
                                                     float gridShare) {
    const bool hasFront = t.front.id[i] != TileFront::kOther, hasExact = t.exact[i] < kNoDisc;
    const uint32_t code = uint32_t(min(t.weight[i] * gridShare, 1.0f) * 255.0f + 0.5f);
    Filtered out{};
    // Other kinds win within what the surface may be rough; rims do not show before them.
    out.isThere = hasFront ? uintBitsToFloat(t.front.depth[i]) < t.exact[i]
                           : !hasExact && code > 0u && t.rim[i] != TileFront::kOther;
    if (!out.isThere) return out;
    const uint32_t id = hasFront ? t.front.id[i] : t.rim[i];
    const PointRecord& r = recordOf(blocks, id);
    float depth = t.own[i];
    if (t.weight[i] > kLeastWeight) {
        const float over = 1.0f / t.weight[i];
        const float linear = t.linear[i] * over;
        depth = kOrthographic ? linear : 1.0f / linear;
        out.pixel.colour = packColour(t.red[i] * over, t.green[i] * over, t.blue[i] * over);
        out.pixel.normal = octEncode(vec3(t.nx[i], t.ny[i], t.nz[i]));
    } else {
        const WideDisc d = wideDisc(*blocks[id / kBlockLanes].node, r, 1.0f, id, lensHere(f.focal));
        const float towards = dot(d.normal, sightTo(lensHere(f.focal), d.centre)) > 0.0f ? -1.0f : 1.0f;
        out.pixel.colour = colourOf(f, tables, blocks, id, r.colour);
        out.pixel.normal = octEncode(vec3(d.normal.x * towards, d.normal.y * towards, d.normal.z * towards));
    }
    const bool isBefore = hasFront && (t.behind[i] != 0u || hasExact);
    out.pixel.cover = (isBefore ? 255u : code) | (hasFront ? kFilteredFront : 0u) |
                      ((recordFlags(r) & kFlagLeaf) != 0u ? kFilteredLeaf : 0u);
    out.key = visibilityKey(floatBitsToUint(depth), drawId(0u, id));
    return out;
}

void filterTile(const FrameConstants& frame, const Tables& tables, const BlockSource* blocks, const PlacedSplat* splats,
                const uint32_t* colours, const uint32_t* places, size_t count, const SplatTile& tile,
                const Visibility& visibility, FilteredPixel* filtered) {
    const FrameConstants f = frame;
    TileFilter t;
    beginFilter(f, tile, visibility, t);
    SplatBatch batch;
    FilterBatch kernels;
    for (size_t first = 0; first < count; first += SplatBatch::kSize) {
        const size_t n = count - first < SplatBatch::kSize ? count - first : SplatBatch::kSize;
        prepareSplats(f, splats, places + first, n, tile, batch);
        for (size_t i = 0; i < n; ++i) {
            const PlacedSplat& s = splats[places[first + i]];
            drawFront(batch, i, roughness(s.radius, colours[places[first + i]]), s.id, tile, f, t);
        }
    }
    const float end = kernelEnd(f.kernelSupport), gridShare = gridWeight(f.kernelSupport);
    for (size_t first = 0; first < count; first += SplatBatch::kSize) {
        const size_t n = count - first < SplatBatch::kSize ? count - first : SplatBatch::kSize;
        if (count > SplatBatch::kSize) prepareSplats(f, splats, places + first, n, tile, batch);
        prepareKernels(f, tables, blocks, splats, colours, places + first, n, batch, kernels);
        for (size_t i = 0; i < n; ++i) {
            const uint32_t id = splats[places[first + i]].id;
            const auto add = kernels.isNear[i] > 0.5f ? addKernel<true> : addKernel<false>;
            add(batch, kernels, i, id, tile, f, end, t);
        }
    }
    for (size_t y = 0; y < tile.height; ++y) {
        const size_t first = (tile.y0 + y) * f.width + tile.x0;
        for (size_t x = 0; x < tile.width; ++x) {
            const Filtered p = filteredPixel(f, tables, blocks, t, y * SplatTile::kWidth + x, gridShare);
            if (!p.isThere) continue;
            visibility.keys[first + x] = p.key;
            filtered[first + x] = p.pixel;
        }
        for (size_t r = first >> Visibility::kRunBits; r <= (first + tile.width - 1) >> Visibility::kRunBits; ++r)
            __atomic_store_n(&visibility.runs[r], uint8_t{1}, __ATOMIC_RELAXED);
    }
}

/// 1 where no opaque surface is: those of a row and their neighbours make silhouettes.
void openRow(const FrameConstants& frame, const uint64_t* keys, const FilteredPixel* filtered, uint32_t n,
             uint8_t* open) {
    const BlockRanges first = frame.firstBlock;
    for (size_t i = 0; i < n; ++i) {
        const bool isRim = isPointKey(keys[i], first) && (filtered[i].cover & kFilteredFront) == 0u;
        open[i] = keys[i] == kNoKey || isRim ? 1 : 0;
    }
}
