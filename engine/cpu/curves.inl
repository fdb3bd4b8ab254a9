// Ribbons and tubes of the cpu backend: segments as lines into the visibility buffer, and texels back out of it.
// Included by kernels.inl.
#include "engine/cpu/filled_curves.inl"

[[gnu::always_inline]] inline CameraSegment cameraSegment(const DrawNode& node, const CurveSegment& s) {
    const auto place = [&](const CurveVertex& v) {
        const float x = float(int(v.positionXY & 0xffffu)), y = float(int(v.positionXY >> 16)),
                    z = float(int(v.positionZ & 0xffffu));
        return vec3(node.base.x + node.axisX.x * x + node.axisY.x * y + node.axisZ.x * z,
                    node.base.y + node.axisX.y * x + node.axisY.y * y + node.axisZ.y * z,
                    node.base.z + node.axisX.z * x + node.axisY.z * y + node.axisZ.z * z);
    };
    CameraSegment c;
    c.a = place(s.a);
    c.b = place(s.b);
    c.radiusA = curveRadius(s.a, node.edge);
    c.radiusB = curveRadius(s.b, node.edge);
    c.directionA = nodeDirection(node, octDecode(s.a.direction));
    c.directionB = nodeDirection(node, octDecode(s.b.direction));
    c.isRound = float(int(s.a.positionZ >> 31));
    return c;
}

/// The eight words of one segment out of a plain array of them.
[[gnu::always_inline]] inline CurveSegment segmentAt(const uint32_t* __restrict words, size_t i) {
    CurveSegment s;
    s.a.positionXY = words[8 * i];
    s.a.positionZ = words[8 * i + 1];
    s.a.direction = words[8 * i + 2];
    s.a.colour = words[8 * i + 3];
    s.b.positionXY = words[8 * i + 4];
    s.b.positionZ = words[8 * i + 5];
    s.b.direction = words[8 * i + 6];
    s.b.colour = words[8 * i + 7];
    return s;
}

/// Projected segments of a block, as what their pixels need. (Aligned as a whole: elements of arrays that are aligned
/// themselves cannot be gathered.)
struct alignas(64) Lines {
    float xa[kSegmentsPerBlock], ya[kSegmentsPerBlock], xb[kSegmentsPerBlock], yb[kSegmentsPerBlock];
    float inverseA[kSegmentsPerBlock], inverseB[kSegmentsPerBlock];  ///< imageLinear of the axis
    float halfA[kSegmentsPerBlock], halfB[kSegmentsPerBlock];        ///< seen half-widths, px
    float nearerA[kSegmentsPerBlock], nearerB[kSegmentsPerBlock];    ///< surfaceStep
    float isRound[kSegmentsPerBlock], isFilled[kSegmentsPerBlock];
    uint32_t rank[kSegmentsPerBlock];  ///< curveRank
    uint32_t keep[kSegmentsPerBlock];
    // As one-pixel lines: along u, the axis along which they are longer, from `first` on; values at u = start, and
    // their slopes.
    float start[kSegmentsPerBlock], v[kSegmentsPerBlock], dv[kSegmentsPerBlock];
    float inverse[kSegmentsPerBlock], dInverse[kSegmentsPerBlock];
    float nearer[kSegmentsPerBlock], dNearer[kSegmentsPerBlock];
    float half[kSegmentsPerBlock], dHalf[kSegmentsPerBlock];  ///< half-widths, px
    float longer[kSegmentsPerBlock];                          ///< length / that along u
    float isSteep[kSegmentsPerBlock];
    int first[kSegmentsPerBlock], count[kSegmentsPerBlock];
    // Ends as points.
    uint32_t pixelA[kSegmentsPerBlock], pixelB[kSegmentsPerBlock];  ///< ~0: none
};

/// Pixels of many short lines, to be worked on together.
struct LinePixels {
    static constexpr size_t kMost = 1024;
    alignas(64) uint32_t segment[kMost];
    alignas(64) int at[kMost];
    alignas(64) uint32_t pixel[kMost], depth[kMost];  ///< pixel ~0: not covered
};

/// How the segments of a block lie on the image as lines of one pixel's width, and which pixels their ends are.
void layLines(const FrameConstants& frame, Lines& lines, size_t count) {
    const FrameConstants f = frame;
    const float width = float(int(f.width)), height = float(int(f.height));
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const float xa = lines.xa[i], ya = lines.ya[i], xb = lines.xb[i], yb = lines.yb[i];
        const float dx = std::fabs(xb - xa), dy = std::fabs(yb - ya);
        const bool isSteep = dy > dx;
        const float ua = isSteep ? ya : xa, ub = isSteep ? yb : xb, va = isSteep ? xa : ya, vb = isSteep ? xb : yb;
        const bool isBack = ub < ua;
        const float u0 = isBack ? ub : ua, u1 = isBack ? ua : ub, v0 = isBack ? vb : va, v1 = isBack ? va : vb;
        const float i0 = isBack ? lines.inverseB[i] : lines.inverseA[i],
                    i1 = isBack ? lines.inverseA[i] : lines.inverseB[i];
        const float n0 = isBack ? lines.nearerB[i] : lines.nearerA[i],
                    n1 = isBack ? lines.nearerA[i] : lines.nearerB[i];
        const float w0 = isBack ? lines.halfB[i] : lines.halfA[i], w1 = isBack ? lines.halfA[i] : lines.halfB[i];
        const float length = u1 - u0, slope = 1.0f / max(length, 1.0e-6f);
        const float first = max(0.0f, std::ceil(u0 - 0.5f));
        const float last = min(std::ceil(u1 - 0.5f) - 1.0f, (isSteep ? height : width) - 1.0f);
        const float tilt = (v1 - v0) * slope, longer = std::sqrt(1.0f + tilt * tilt);
        lines.start[i] = u0;
        lines.v[i] = v0;
        lines.dv[i] = tilt;
        lines.inverse[i] = i0;
        lines.dInverse[i] = (i1 - i0) * slope;
        lines.nearer[i] = n0;
        lines.dNearer[i] = (n1 - n0) * slope;
        lines.half[i] = w0;
        lines.dHalf[i] = (w1 - w0) * slope;
        lines.isSteep[i] = isSteep ? 1.0f : 0.0f;
        lines.first[i] = int(min(first, 32767.0f));
        const float pixels = length > 0.0f ? max(0.0f, last - first + 1.0f) : 0.0f;
        lines.count[i] = int(min(pixels, 32767.0f));
        lines.longer[i] = longer;
        // Every vertex as a point: a segment that is seen along its axis has no line.
        const auto point = [&](float x, float y, float half) {
            const float inside = (x >= 0.0f ? 1.0f : 0.0f) * (x < width ? 1.0f : 0.0f) * (y >= 0.0f ? 1.0f : 0.0f) *
                                 (y < height ? 1.0f : 0.0f);
            const uint32_t pixel =
                uint32_t(int(inside > 0.5f ? y : 0.0f)) * f.width + uint32_t(int(inside > 0.5f ? x : 0.0f));
            const float dot_ = 3.14159265f * half * half * (1.0f - max(dx, dy) / max(2.0f * half, 1.0e-6f));
            const float share = half < kNarrow ? dot_ : 2.0f;
            const float isSeen = coverageThreshold(pixel, ~lines.rank[i], f.coverageSeed) < share ? inside : 0.0f;
            return isSeen > 0.5f ? pixel : ~0u;
        };
        lines.pixelA[i] = point(xa, ya, lines.halfA[i]);
        lines.pixelB[i] = point(xb, yb, lines.halfB[i]);
    }
}

/// Offers the pixels that were collected.
void drawPixels(const FrameConstants& frame, const Lines& lines, LinePixels& pixels, size_t count, uint32_t firstPlace,
                const Visibility& visibility) {
    const FrameConstants f = frame;
    const float width = float(int(f.width)), height = float(int(f.height));
    const uint32_t* __restrict const segment = pixels.segment;
    const int* __restrict const at = pixels.at;
    const float *const start = lines.start, *const v0 = lines.v, *const dv = lines.dv, *const half0 = lines.half,
                       *const dHalf = lines.dHalf, *const longer = lines.longer, *const nearer = lines.nearer,
                       *const dNearer = lines.dNearer, *const inverse = lines.inverse, *const dInverse = lines.dInverse,
                       *const steep = lines.isSteep;
    const uint32_t* const rank = lines.rank;
    uint32_t* __restrict const depth = pixels.depth, * __restrict const pixel = pixels.pixel;
    const Lens lens = lensHere(f.focal);
    const float nearPlane = f.nearPlane;
#pragma GCC ivdep
    for (size_t k = 0; k < count; ++k) {
        const uint32_t i = segment[k];
        const float u = float(at[k]) + 0.5f - start[i];
        const float v = v0[i] + u * dv[i], half = half0[i] + u * dHalf[i];
        const bool isSteep = steep[i] > 0.5f;
        const float inside = (v >= 0.0f ? 1.0f : 0.0f) * (v < (isSteep ? width : height) ? 1.0f : 0.0f);
        const uint32_t row = uint32_t(int(inside > 0.5f ? v : 0.0f)), column = uint32_t(at[k]);
        const uint32_t where = isSteep ? column * f.width + row : row * f.width + column;
        const float covered = 2.0f * half * longer[i], share = half < kNarrow ? covered : 2.0f;
        const float taken = coverageThreshold(where, rank[i], f.coverageSeed) < share ? inside : 0.0f;
        depth[k] =
            floatBitsToUint(lineDepth(lens, inverse[i] + u * dInverse[i], nearer[i] + u * dNearer[i], nearPlane));
        pixel[k] = taken > 0.5f ? where : ~0u;
    }
    const uint64_t first = drawId(f.firstBlock.of[kKindCurves], firstPlace);
    constexpr size_t kAhead = 24;  // their cache lines come meanwhile
    for (size_t k = 0; k < count; ++k) {
        if (k + kAhead < count && pixels.pixel[k + kAhead] != ~0u)
            __builtin_prefetch(&visibility.keys[pixels.pixel[k + kAhead]], 1);
        if (pixels.pixel[k] == ~0u) continue;
        offerKey(visibility, pixels.pixel[k], visibilityKey(pixels.depth[k], first + segment[k]));
    }
}

/// Segments on the image.
[[gnu::always_inline]] inline void placeSegments(const FrameConstants& f, const DrawNode& node,
                                                 const uint32_t* __restrict words, size_t count, Lines& lines) {
    const Lens lens = lensHere(f.focal);
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const CurveSegment s = segmentAt(words, i);
        const CameraSegment c = cameraSegment(node, s);
        const ScreenSegment p = projectSegment(c.a, c.b, lens, f.centre.x, f.centre.y, f.nearPlane);
        const vec3 t = segmentTangent(c);
        const auto at = [&](float place) {
            return vec3(c.a.x + place * (c.b.x - c.a.x), c.a.y + place * (c.b.y - c.a.y),
                        max(c.a.z + place * (c.b.z - c.a.z), f.nearPlane));
        };
        const vec3 a = at(p.from), b = at(p.to);
        const float ra = c.radiusA + p.from * (c.radiusB - c.radiusA), rb = c.radiusA + p.to * (c.radiusB - c.radiusA);
        // The same depth that the texel gets: that of the surface over the axis.
        lines.xa[i] = p.xa;
        lines.ya[i] = p.ya;
        lines.xb[i] = p.xb;
        lines.yb[i] = p.yb;
        lines.inverseA[i] = imageLinear(lens, p.za);
        lines.inverseB[i] = imageLinear(lens, p.zb);
        lines.halfA[i] = endHalfWidth(c, p.from, c.directionA, lens, f.nearPlane);
        lines.halfB[i] = endHalfWidth(c, p.to, c.directionB, lens, f.nearPlane);
        lines.nearerA[i] = surfaceStep(lens, a, t, ra, c.isRound);
        lines.nearerB[i] = surfaceStep(lens, b, t, rb, c.isRound);
        lines.rank[i] = curveRank(s);
        lines.isRound[i] = c.isRound;
        lines.isFilled[i] = isFilled(c, p, lens, f.exactCurves);
        const float isFine = segmentErrorCode(s) <= node.errorCode ? 1.0f : 0.0f;
        const float isOfOctant = (segmentOctants(s) & node.octantMask) != 0u ? 1.0f : 0.0f;
        const float reaches =
            curveReaches(c, lens, f.centre.x, f.centre.y, float(int(f.width)), float(int(f.height)), f.nearPlane);
        lines.keep[i] = min(max(isFine, isOfOctant), max(p.isThere, reaches)) > 0.5f ? 1u : 0u;
    }
}

/// A filled segment: its pixels here, or, of one that covers much of the image, by all threads.
void drawFilled(const FrameConstants& f, const CameraSegment& c, bool isRound, uint64_t id, const WideSink& wide,
                const Visibility& visibility) {
    const float width = float(f.width), height = float(f.height);
    const FilledCurve s = isRound ? wideTube(f, c, id) : wideRibbon(f, c, id);
    float left, right, top, bottom;
    if (isRound) {
        left = min(s.left[0], s.left[1]);
        right = max(s.right[0], s.right[1]);
        top = min(s.top[0], s.top[1]);
        bottom = max(s.bottom[0], s.bottom[1]);
        if (left >= width || top >= height) return;
    } else {
        left = min(min(s.x[0], s.x[1]), min(s.x[2], s.x[3]));
        right = max(max(s.x[0], s.x[1]), max(s.x[2], s.x[3]));
        top = min(min(s.y[0], s.y[1]), min(s.y[2], s.y[3]));
        bottom = max(max(s.y[0], s.y[1]), max(s.y[2], s.y[3]));
        if (left > width || top > height) return;
    }
    if (right < 0.0f || bottom < 0.0f) return;
    if (min(bottom - top, height) * min(right - left, width) > float(kLargePixels))
        wide.keep(wide.context, s);
    else
        fillCurve(f, s, 0, int(f.height) - 1, visibility);
}

void drawSegments(const FrameConstants& frame, const CurveBlock& block, uint32_t count, uint32_t firstPlace,
                  const WideSink& wide, const Visibility& visibility) {
    const FrameConstants f = frame;
    const DrawNode node = *block.node;
    const uint32_t* __restrict const words = &block.segments->a.positionXY;
    const Lens lens = lensHere(f.focal);
    Lines lines;
    placeSegments(f, node, words, count, lines);
    layLines(f, lines, count);
    LinePixels pixels;
    size_t collected = 0;
    for (size_t i = 0; i < count; ++i) {
        if (lines.keep[i] == 0) continue;
        const uint64_t id = drawId(f.firstBlock.of[kKindCurves], firstPlace + uint32_t(i));
        if (lines.isFilled[i] > 0.5f) {
            drawFilled(f, cameraSegment(node, segmentAt(words, i)), lines.isRound[i] > 0.5f, id, wide, visibility);
            continue;
        }
        for (int k = 0; k < lines.count[i]; ++k) {
            pixels.segment[collected] = uint32_t(i);
            pixels.at[collected] = lines.first[i] + k;
            if (++collected < LinePixels::kMost) continue;
            drawPixels(f, lines, pixels, collected, firstPlace, visibility);
            collected = 0;
        }
        // (In perspective what is linear on the image is divided twice, as ever.)
        const auto end = [&](float linear, float nearer) {
            return kOrthographic ? lineDepth(lens, linear, nearer, f.nearPlane) : linear / nearer;
        };
        if (lines.pixelA[i] != ~0u) offer(visibility, lines.pixelA[i], end(lines.inverseA[i], lines.nearerA[i]), id);
        if (lines.pixelB[i] != ~0u) offer(visibility, lines.pixelB[i], end(lines.inverseB[i], lines.nearerB[i]), id);
    }
    drawPixels(f, lines, pixels, collected, firstPlace, visibility);
}

void fillWide(const FrameConstants& frame, const FilledCurve* curves, size_t count, uint32_t firstRow, uint32_t lastRow,
              const Visibility& visibility) {
    const FrameConstants f = frame;
    for (size_t i = 0; i < count; ++i) fillCurve(f, curves[i], int(firstRow), int(lastRow), visibility);
}

/// Segments of the pixels of a row, as stored, and their nodes.
struct CurvePixels {
    alignas(64) uint32_t words[8][kTile];
    alignas(64) float base[3][kTile], axes[9][kTile], edge[kTile];
};
struct CurveTexels {
    alignas(64) float depth[kTile], radius[kTile], thickness[kTile], x[kTile], y[kTile], perpX[kTile], perpY[kTile],
        red[kTile], green[kTile], blue[kTile], isRound[kTile], axisX[kTile], axisY[kTile],
        filled[kTile];  ///< filled: kFilledRibbon, kFilledTube or 0
};

constexpr int kFilledRibbon = 1, kFilledTube = 2;

[[gnu::always_inline]] inline CurveSegment packedOf(const CurvePixels& e, size_t i) {
    return {{e.words[0][i], e.words[1][i], e.words[2][i], e.words[3][i]},
            {e.words[4][i], e.words[5][i], e.words[6][i], e.words[7][i]}};
}
[[gnu::always_inline]] inline DrawNode nodeOf(const CurvePixels& e, size_t i) {
    DrawNode node{};
    node.base = vec3(e.base[0][i], e.base[1][i], e.base[2][i]);
    node.axisX = vec3(e.axes[0][i], e.axes[1][i], e.axes[2][i]);
    node.axisY = vec3(e.axes[3][i], e.axes[4][i], e.axes[5][i]);
    node.axisZ = vec3(e.axes[6][i], e.axes[7][i], e.axes[8][i]);
    node.edge = e.edge[i];
    return node;
}

/// One of a segment's colours, linear, at a place from 0 to 1.
[[gnu::always_inline]] inline float mixedColour(const CurveSegment& s, uint32_t shift, float place) {
    const float a = linearFromByte(float(int(s.a.colour >> shift & 255u)) * (1.0f / 255.0f));
    const float b = linearFromByte(float(int(s.b.colour >> shift & 255u)) * (1.0f / 255.0f));
    return a + place * (b - a);
}

/// Filled tubes or filled ribbons, by the rays of their pixels: side by side, or they would not be worked on together.
/// (ex0, ey): the row's first pixel, px from the principal point, over the focal length.
template <int kind>
void resolveFilled(const FrameConstants& f, const CurvePixels& e, const WinningPixels& p, float ex0, float ey,
                   CurveTexels& o) {
    CurvePixels t;
    alignas(64) float pixel[kTile], depth[kTile], perpX[kTile], perpY[kTile], red[kTile], green[kTile], blue[kTile];
    alignas(64) uint32_t from[kTile];
    size_t filled = 0;
    for (size_t i = 0; i < p.count; ++i) {
        if (o.filled[i] != float(kind)) continue;
        for (size_t k = 0; k < 8; ++k) t.words[k][filled] = e.words[k][i];
        for (size_t k = 0; k < 3; ++k) t.base[k][filled] = e.base[k][i];
        for (size_t k = 0; k < 9; ++k) t.axes[k][filled] = e.axes[k][i];
        t.edge[filled] = e.edge[i];
        pixel[filled] = float(int(p.pixel[i]));
        from[filled++] = uint32_t(i);
    }
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const Lens lens = lensHere(f.focal);
#pragma GCC ivdep
    for (size_t k = 0; k < filled; ++k) {
        const CurveSegment packed = packedOf(t, k);
        const CameraSegment s = cameraSegment(nodeOf(t, k), packed);
        const PixelRay ray = pixelRay(lens, ex0 + pixel[k] * inverseFocal, ey);
        FilledPixel seen;
        if constexpr (kind == kFilledTube)
            seen = tubePixel(s, ray, nearPlane);
        else
            seen = ribbonPixel(s, ray, nearPlane);
        depth[k] = seen.depth;
        perpX[k] = seen.normalPerp.x;
        perpY[k] = seen.normalPerp.y;
        red[k] = mixedColour(packed, 0, seen.place);
        green[k] = mixedColour(packed, 8, seen.place);
        blue[k] = mixedColour(packed, 16, seen.place);
    }
    for (size_t k = 0; k < filled; ++k) {
        const size_t i = from[k];
        const bool isHit = depth[k] < kNoDepth;
        o.depth[i] = isHit ? depth[k] : o.depth[i];
        o.radius[i] = 0.25f;
        o.thickness[i] = kind == kFilledTube ? 0.25f : kLeafThickness * 0.25f;  // a filled ribbon is a leaf
        o.x[i] = o.y[i] = 0.0f;
        o.perpX[i] = isHit ? perpX[k] : 0.0f;
        o.perpY[i] = isHit ? perpY[k] : 0.0f;
        o.isRound[i] = o.axisX[i] = o.axisY[i] = 0.0f;
        o.red[i] = red[k];
        o.green[i] = green[k];
        o.blue[i] = blue[k];
    }
}

/// Follows the pointers.
[[gnu::always_inline]] inline void gatherCurves(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p,
                                                CurvePixels& e) {
    const size_t n = p.count;
    constexpr size_t kAhead = 10;  // pixels: segments lie anywhere in memory
    for (size_t i = 0; i < n; ++i) {
        if (i + kAhead < n) {
            const uint32_t ahead = p.id[i + kAhead];
            __builtin_prefetch(in.curveBlocks[ahead / kSegmentsPerBlock].segments + ahead % kSegmentsPerBlock);
        }
        const CurveBlock& block = in.curveBlocks[p.id[i] / kSegmentsPerBlock];
        const uint32_t* const words = &block.segments[p.id[i] % kSegmentsPerBlock].a.positionXY;
        const DrawNode& node = *block.node;
        for (size_t k = 0; k < 8; ++k) e.words[k][i] = words[k];
        e.base[0][i] = node.base.x;
        e.base[1][i] = node.base.y;
        e.base[2][i] = node.base.z;
        const float* const axes = &node.axisX.x;
        for (size_t k = 0; k < 9; ++k) e.axes[k][i] = axes[k];
        e.edge[i] = node.edge;
        if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
            const vec3 d =
                f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
            const auto byte = [](float l) { return uint32_t(int(srgbFromLinear(l) * 255.0f + 0.5f)); };
            e.words[3][i] = e.words[7][i] = byte(d.x) | byte(d.y) << 8 | byte(d.z) << 16;
        }
    }
}

/// (cx, cy): the principal point from the row's first pixel's centre on.
[[gnu::always_inline]] inline void reconstructCurves(const FrameConstants& f, const CurvePixels& e,
                                                     const WinningPixels& p, float cx, float cy, CurveTexels& o) {
    const size_t n = p.count;
    const float nearPlane = f.nearPlane, support = f.supportScale;
    const Lens lens = lensHere(f.focal);
    const vec3 sun = f.sunDirection;
    const float exactCurves = f.exactCurves;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const CurveSegment packed = packedOf(e, i);
        const CameraSegment s = cameraSegment(nodeOf(e, i), packed);
        const float px = float(int(p.pixel[i]));
        // Image coordinates from this pixel's centre on, so that the low bits are kept.
        const ScreenSegment on = projectSegment(s.a, s.b, lens, cx - px, cy, nearPlane);
        const CurvePixel seen = curvePixel(s, on, support, lens, cx - px, cy, nearPlane, sun);
        const Texel t = seen.texel;
        const float place = seen.place;
        o.depth[i] = t.depth;
        o.radius[i] = t.radius;
        o.thickness[i] = t.thickness;
        o.x[i] = t.offset.x;
        o.y[i] = t.offset.y;
        o.perpX[i] = t.normalPerp.x;
        o.perpY[i] = t.normalPerp.y;
        o.isRound[i] = t.isRound;
        o.axisX[i] = t.axis.x;
        o.axisY[i] = t.axis.y;
        o.filled[i] = isFilled(s, on, lens, exactCurves) *
                      (float(kFilledRibbon) + s.isRound * float(kFilledTube - kFilledRibbon));
        o.red[i] = mixedColour(packed, 0, place);
        o.green[i] = mixedColour(packed, 8, place);
        o.blue[i] = mixedColour(packed, 16, place);
    }
}

/// Texels of the pixels that show curves; is any of them a tube to be reconstructed?
bool resolveCurves(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, uint32_t x0, uint32_t y,
                   TexelRow& __restrict row, float& largestRadius) {
    CurvePixels e;
    CurveTexels o;
    const size_t n = p.count;
    gatherCurves(f, in, p, e);
    const float focal = f.focal, cx = f.centre.x - float(int(x0)) - 0.5f, cy = f.centre.y - float(int(y)) - 0.5f;
    reconstructCurves(f, e, p, cx, cy, o);
    const float ex0 = -cx / focal, ey = -cy / focal;
    resolveFilled<kFilledTube>(f, e, p, ex0, ey, o);
    resolveFilled<kFilledRibbon>(f, e, p, ex0, ey, o);
    float round_ = 0;
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + p.pixel[i];
        row.depth[at] = o.depth[i];
        row.radius[at] = o.radius[i];
        row.thickness[at] = o.thickness[i];
        row.x[at] = o.x[i];
        row.y[at] = o.y[i];
        row.perpX[at] = o.perpX[i];
        row.perpY[at] = o.perpY[i];
        row.red[at] = o.red[i];
        row.green[at] = o.green[i];
        row.blue[at] = o.blue[i];
        row.isRound[at] = o.isRound[i];
        row.axisX[at] = o.axisX[i];
        row.axisY[at] = o.axisY[i];
        largestRadius = max(largestRadius, o.radius[i]);
        round_ = max(round_, max(o.isRound[i], o.axisX[i] > kAllRibbon ? 1.0f : 0.0f));
    }
    return round_ > 0.0f;
}
