// Ribbons and tubes of the cpu backend: segments into the visibility buffer, as lines or filled.
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
    uint32_t depthA[kSegmentsPerBlock], depthB[kSegmentsPerBlock];  ///< bits
};

/// Pixels of many short lines, to be worked on together.
struct LinePixels {
    static constexpr size_t kMost = 1024;
    alignas(64) uint32_t segment[kMost];
    alignas(64) int at[kMost];
    alignas(64) uint32_t pixel[kMost], depth[kMost];  ///< pixel ~0: not covered
};
/// Ends of many, which are asked for together.
struct EndPixels {
    static constexpr size_t kMost = 256;
    uint32_t segment[kMost + 2], pixel[kMost + 2], depth[kMost + 2];
};
static_assert(EndPixels::kMost + 2 <= LinePixels::kMost, "offerAll has room for these, too");

/// How the segments of a block lie on the image as lines of one pixel's width, and which pixels their ends are.
void layLines(const FrameConstants& frame, Lines& lines, size_t count) {
    const FrameConstants f = frame;
    const float width = float(int(f.width)), height = float(int(f.height));
    const Lens lens = lensHere(f.focal);
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
        // (In perspective what is linear on the image is divided twice, as ever.)
        const auto depth = [&](float linear, float nearer) {
            const float end = kOrthographic ? lineDepth(lens, linear, nearer, f.nearPlane) : linear / nearer;
            return floatBitsToUint(depthOfLinear(lens, end));
        };
        lines.depthA[i] = depth(lines.inverseA[i], lines.nearerA[i]);
        lines.depthB[i] = depth(lines.inverseB[i], lines.nearerB[i]);
    }
}

/// Offers pixels of segments of a block; ~0: none. Which are some, and which of those are in front, is as good as
/// random: both are found without branches, and their cache lines are asked for some of them ahead.
[[gnu::always_inline]] inline void offerAll(const Visibility& visibility, const uint32_t* pixel, const uint32_t* depth,
                                            const uint32_t* segment, size_t count, uint64_t firstId) {
    constexpr size_t kAhead = 24;
    uint32_t some[LinePixels::kMost], front[LinePixels::kMost];
    size_t n = 0, m = 0;
    for (size_t k = 0; k < count; ++k) {
        some[n] = uint32_t(k);
        n += pixel[k] != ~0u ? 1u : 0u;
    }
    for (size_t k = 0; k < n && k < kAhead; ++k) __builtin_prefetch(&visibility.keys[pixel[some[k]]], 1);
    for (size_t k = 0; k < n; ++k) {
        const uint32_t i = some[k], ahead = some[k + kAhead < n ? k + kAhead : k];
        __builtin_prefetch(&visibility.keys[pixel[ahead]], 1);
        const uint64_t key = visibilityKey(depth[i], firstId + segment[i]);
        front[m] = i;
        m += key < __atomic_load_n(&visibility.keys[pixel[i]], __ATOMIC_RELAXED) ? 1u : 0u;
    }
    for (size_t k = 0; k < m; ++k) {
        const uint32_t i = front[k];
        offerKey(visibility, pixel[i], visibilityKey(depth[i], firstId + segment[i]));
    }
}

/// Offers the pixels that were collected.
void drawPixels(const FrameConstants& frame, const Lines& lines, LinePixels& pixels, size_t count, uint64_t firstId,
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
    offerAll(visibility, pixels.pixel, pixels.depth, segment, count, firstId);
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

#include "engine/cpu/ribbon_batch.inl"

/// A filled tube: its pixels here, or, of one that covers much of the image, by all threads.
void drawFilledTube(const FrameConstants& f, const CameraSegment& c, uint64_t id, const WideSink& wide,
                    const Visibility& visibility) {
    const float width = float(f.width), height = float(f.height);
    const FilledCurve s = wideTube(f, c, id);
    const float left = min(s.left[0], s.left[1]), right = max(s.right[0], s.right[1]), top = min(s.top[0], s.top[1]),
                bottom = max(s.bottom[0], s.bottom[1]);
    if (isBesidePicture(left, right, top, bottom, width, height) > 0.5f) return;
    if (isLargeBox(left, right, top, bottom, width, height) > 0.5f)
        wide.keep(wide.context, s);
    else
        fillCurve(f, s, 0, int(f.height) - 1, visibility);
}

void drawSegments(const FrameConstants& frame, const CurveBlock& block, uint32_t count, uint32_t firstPlace,
                  const WideSink& wide, const Visibility& visibility) {
    const FrameConstants f = frame;
    const DrawNode node = *block.node;
    const uint32_t* __restrict const words = &block.segments->a.positionXY;
    Lines lines;
    placeSegments(f, node, words, count, lines);
    layLines(f, lines, count);
    LinePixels pixels;
    RibbonBatch ribbons;
    const uint64_t firstId = drawId(f.firstBlock.of[kKindCurves], firstPlace);
    EndPixels ends;
    size_t collected = 0, ended = 0;
    for (size_t i = 0; i < count; ++i) {
        if (lines.keep[i] == 0) continue;
        const uint64_t id = firstId + i;
        if (lines.isFilled[i] > 0.5f) {
            if (lines.isRound[i] > 0.5f) {
                drawFilledTube(f, cameraSegment(node, segmentAt(words, i)), id, wide, visibility);
                continue;
            }
            ribbons.segment[ribbons.count++] = uint32_t(i);
            if (ribbons.count == RibbonBatch::kMost)
                fillBatch(f, node, words, firstId, wide, visibility, ribbons);
            continue;
        }
        for (int k = 0; k < lines.count[i]; ++k) {
            pixels.segment[collected] = uint32_t(i);
            pixels.at[collected] = lines.first[i] + k;
            if (++collected < LinePixels::kMost) continue;
            drawPixels(f, lines, pixels, collected, firstId, visibility);
            collected = 0;
        }
        const auto addEnd = [&](uint32_t pixel, uint32_t depth) {
            ends.segment[ended] = uint32_t(i);
            ends.pixel[ended] = pixel;
            ends.depth[ended] = depth;
            ended += pixel != ~0u ? 1u : 0u;
        };
        addEnd(lines.pixelA[i], lines.depthA[i]);
        addEnd(lines.pixelB[i], lines.depthB[i]);
        if (ended < EndPixels::kMost) continue;
        offerAll(visibility, ends.pixel, ends.depth, ends.segment, ended, firstId);
        ended = 0;
    }
    drawPixels(f, lines, pixels, collected, firstId, visibility);
    offerAll(visibility, ends.pixel, ends.depth, ends.segment, ended, firstId);
    if (ribbons.count > 0) fillBatch(f, node, words, firstId, wide, visibility, ribbons);
}

void fillWide(const FrameConstants& frame, const FilledCurve* curves, size_t count, uint32_t firstRow, uint32_t lastRow,
              const Visibility& visibility) {
    const FrameConstants f = frame;
    for (size_t i = 0; i < count; ++i) fillCurve(f, curves[i], int(firstRow), int(lastRow), visibility);
}
