// Ribbons and tubes of the cpu backend: segments as lines into the visibility buffer, and texels back out of it.
// Included by kernels.inl.

[[gnu::always_inline]] inline CameraSegment cameraSegment(const DrawNode& node, const StrandSegment& s) {
    const auto place = [&](const StrandVertex& v) {
        const float x = float(int(v.positionXY & 0xffffu)), y = float(int(v.positionXY >> 16)),
                    z = float(int(v.positionZ & 0xffffu));
        return vec3(node.base.x + node.axisX.x * x + node.axisY.x * y + node.axisZ.x * z,
                    node.base.y + node.axisX.y * x + node.axisY.y * y + node.axisZ.y * z,
                    node.base.z + node.axisX.z * x + node.axisY.z * y + node.axisZ.z * z);
    };
    CameraSegment c;
    c.a = place(s.a);
    c.b = place(s.b);
    c.radiusA = strandRadius(s.a, node.edge);
    c.radiusB = strandRadius(s.b, node.edge);
    c.directionA = nodeDirection(node, octDecode(s.a.direction));
    c.directionB = nodeDirection(node, octDecode(s.b.direction));
    c.isRound = float(int(s.a.positionZ >> 31));
    return c;
}

/// The eight words of one segment out of a plain array of them.
[[gnu::always_inline]] inline StrandSegment segmentAt(const uint32_t* __restrict words, size_t i) {
    StrandSegment s;
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

/// Projected segments of a block, as what its lines need.
struct Lines {
    alignas(64) float xa[kSegmentsPerBlock], ya[kSegmentsPerBlock], xb[kSegmentsPerBlock], yb[kSegmentsPerBlock];
    alignas(64) float inverseA[kSegmentsPerBlock], inverseB[kSegmentsPerBlock];
    alignas(64) float halfA[kSegmentsPerBlock], halfB[kSegmentsPerBlock];      ///< seen half-widths, px
    alignas(64) float nearerA[kSegmentsPerBlock], nearerB[kSegmentsPerBlock];  ///< depth of the surface / of the axis
    // From a ribbon's axis to its edge, see ribbonEdge.
    alignas(64) float edgeAx[kSegmentsPerBlock], edgeAy[kSegmentsPerBlock], slopeA[kSegmentsPerBlock];
    alignas(64) float edgeBx[kSegmentsPerBlock], edgeBy[kSegmentsPerBlock], slopeB[kSegmentsPerBlock];
    alignas(64) float isRound[kSegmentsPerBlock], radius[kSegmentsPerBlock];  ///< radius: the larger one, px
    alignas(64) uint32_t keep[kSegmentsPerBlock];
};

constexpr int kStretch = 16;  ///< pixels that are worked on together

/// Pixels of one line. x: the axis along which it is longer; `at(column, row)` is the pixel's index or ~0.
struct LineEnds {
    float xa, ya, xb, yb;
    uint32_t columns;
    uint32_t stepX, stepY, rows;  ///< index of a pixel: column * stepX + row * stepY
};

void drawLine(const FrameConstants& f, const Lines& lines, size_t i, LineEnds e, uint32_t id, uint64_t* visibility) {
    float ia = lines.inverseA[i], ib = lines.inverseB[i], wa = lines.halfA[i], wb = lines.halfB[i],
          fa = lines.nearerA[i], fb = lines.nearerB[i];
    if (e.xb < e.xa) {
        exchange(e.xa, e.xb);
        exchange(e.ya, e.yb);
        exchange(ia, ib);
        exchange(wa, wb);
        exchange(fa, fb);
    }
    const float length = e.xb - e.xa;
    const float first = max(std::ceil(e.xa - 0.5f), 0.0f);
    const float last = min(std::ceil(e.xb - 0.5f) - 1.0f, float(int(e.columns)) - 1.0f);
    if (!(first <= last) || !(length > 0)) return;
    const float slope = (e.yb - e.ya) / length, longer = std::sqrt(1.0f + slope * slope), inverse = 1.0f / length;
    const float rows = float(int(e.rows)), dy = e.yb - e.ya, di = ib - ia, dw = wb - wa, df = fb - fa;
    // First where the pixels are and how deep, then, with their cache lines on the way, the minimum.
    alignas(64) uint32_t pixel[kStretch], depth[kStretch], keep[kStretch];
    const int end = int(last);
    for (int x0 = int(first); x0 <= end; x0 += kStretch) {
#pragma GCC ivdep
        for (size_t k = 0; k < kStretch; ++k) {
            const int x = x0 + int(k);
            const float u = (float(x) + 0.5f - e.xa) * inverse, y = e.ya + u * dy, half = wa + u * dw;
            const float inside = (y >= 0 ? 1.0f : 0.0f) * (y < rows ? 1.0f : 0.0f) * (x <= end ? 1.0f : 0.0f);
            const int row = int(inside > 0.5f ? y : 0.0f);
            pixel[k] = uint32_t(inside > 0.5f ? x : x0) * e.stepX + uint32_t(row) * e.stepY;
            const float share = half < kNarrow ? 2.0f * half * longer : 2.0f;
            const float taken = coverageThreshold(pixel[k], id, f.coverageSeed) < share ? inside : 0.0f;
            depth[k] = floatBitsToUint((fa + u * df) / (ia + u * di));
            keep[k] = taken > 0.5f ? 1u : 0u;
        }
        const int count = end - x0 + 1 < kStretch ? end - x0 + 1 : kStretch;
        for (int k = 0; k < count; ++k)
            if (keep[k] != 0) __builtin_prefetch(&visibility[pixel[k]], 1);
        for (int k = 0; k < count; ++k)
            if (keep[k] != 0) offerKey(visibility, pixel[k], uint64_t{depth[k]} << 32 | id);
    }
}

/// Rows [firstRow, lastRow] of a wide strand: every pixel whose centre is within its half-width.
void fillStrand(const FrameConstants& f, const WideStrand& s, int firstRow, int lastRow, uint64_t* visibility) {
    const float dx = s.xb - s.xa, dy = s.yb - s.ya, length2 = dx * dx + dy * dy;
    const float inverse2 = length2 > 1.0e-8f ? 1.0f / length2 : 0.0f;
    const int top = int(max(min(s.ya, s.yb) - s.widest, float(firstRow))),
              bottom = int(min(max(s.ya, s.yb) + s.widest, float(lastRow)));
    const RibbonEdge a = s.edgeA, b = s.edgeB;
    const float nearPlane = f.nearPlane;
    for (int y = top; y <= bottom; ++y) {
        const float cy = float(y) + 0.5f;
        // Where the axis is within reach of this row.
        float from = min(s.xa, s.xb), to = max(s.xa, s.xb);
        if (std::fabs(dy) > 1.0e-6f) {
            const float u0 = (cy - s.widest - s.ya) / dy, u1 = (cy + s.widest - s.ya) / dy;
            const float lo = min(max(min(u0, u1), 0.0f), 1.0f), hi = min(max(max(u0, u1), 0.0f), 1.0f);
            const float x0 = s.xa + lo * dx, x1 = s.xa + hi * dx;
            from = min(x0, x1);
            to = max(x0, x1);
        }
        const int left = int(max(from - s.widest, 0.0f)), right = int(min(to + s.widest, float(int(f.width)) - 1.0f));
        const float py = cy - s.ya;
        for (int x0 = left; x0 <= right; x0 += kStretch) {
            alignas(64) uint32_t depth[kStretch], keep[kStretch];
            const int count = right - x0 + 1 < kStretch ? right - x0 + 1 : kStretch;
            const float px0 = float(x0) + 0.5f - s.xa;
            if (s.isRound) {
#pragma GCC ivdep
                for (size_t k = 0; k < kStretch; ++k) {
                    const float px = px0 + float(int(k));
                    const float u = min(max((px * dx + py * dy) * inverse2, 0.0f), 1.0f);
                    const float ex = px - u * dx, ey = py - u * dy, half = s.halfA + u * (s.halfB - s.halfA);
                    const float q = (ex * ex + ey * ey) / (half * half);
                    const float rise = std::sqrt(max(1.0f - q, 0.0f));
                    const float nearer = 1.0f - rise * (1.0f - (s.nearerA + u * (s.nearerB - s.nearerA)));
                    depth[k] = floatBitsToUint(max(nearer / (s.inverseA + u * (s.inverseB - s.inverseA)), nearPlane));
                    keep[k] = q <= 1.0f ? 1u : 0u;
                }
            } else {
#pragma GCC ivdep
                for (size_t k = 0; k < kStretch; ++k) {
                    const RibbonPlace p = ribbonPlace(px0 + float(int(k)), py, dx, dy, a, b);
                    const float u = p.along, nearer = 1.0f + p.across * (a.slope + u * (b.slope - a.slope));
                    depth[k] = floatBitsToUint(max(nearer / (s.inverseA + u * (s.inverseB - s.inverseA)), nearPlane));
                    keep[k] = std::fabs(p.across) <= 1.0f ? 1u : 0u;
                }
            }
            uint64_t* const row = visibility + size_t(y) * f.width + size_t(x0);
            for (int k = 0; k < count; ++k)
                if (keep[k] != 0) offerKey(row, size_t(k), uint64_t{depth[k]} << 32 | s.id);
        }
    }
}

void drawSegments(const FrameConstants& frame, const StrandBlock& block, uint32_t count, uint32_t firstId,
                  const WideSink& wide, uint64_t* visibility) {
    const FrameConstants f = frame;
    const DrawNode node = *block.node;
    const uint32_t* __restrict const words = &block.segments->a.positionXY;
    Lines lines;
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const StrandSegment s = segmentAt(words, i);
        const CameraSegment c = cameraSegment(node, s);
        const ScreenSegment p = projectSegment(c.a, c.b, f.focal, f.centre.x, f.centre.y, f.nearPlane);
        const vec3 t = segmentTangent(c);
        const auto at = [&](float place) {
            return vec3(c.a.x + place * (c.b.x - c.a.x), c.a.y + place * (c.b.y - c.a.y),
                        max(c.a.z + place * (c.b.z - c.a.z), f.nearPlane));
        };
        const vec3 a = at(p.from), b = at(p.to);
        const float ra = c.radiusA + p.from * (c.radiusB - c.radiusA), rb = c.radiusA + p.to * (c.radiusB - c.radiusA);
        // The same depth that the texel gets: that of the surface over the axis.
        const auto nearer = [&](const vec3& end, float radius) {
            const float distance = std::sqrt(max(dot(end, end), 1.0e-30f));
            const float tv = dot(t, end) / distance;
            const float front =
                min(min(radius / std::sqrt(max(1.0f - tv * tv, 1.0e-6f)), 4.0f * radius), 0.9f * distance);
            return c.isRound > 0.5f ? 1.0f - front / distance : 1.0f;
        };
        lines.xa[i] = p.xa;
        lines.ya[i] = p.ya;
        lines.xb[i] = p.xb;
        lines.yb[i] = p.yb;
        lines.inverseA[i] = 1.0f / p.za;
        lines.inverseB[i] = 1.0f / p.zb;
        lines.halfA[i] = endHalfWidth(c, p.from, c.directionA, f.focal, f.nearPlane);
        lines.halfB[i] = endHalfWidth(c, p.to, c.directionB, f.focal, f.nearPlane);
        lines.nearerA[i] = nearer(a, ra);
        lines.nearerB[i] = nearer(b, rb);
        const RibbonEdge edgeA = ribbonEdge(a, c.directionA, ra, f.focal),
                         edgeB = ribbonEdge(b, c.directionB, rb, f.focal);
        lines.edgeAx[i] = edgeA.x;
        lines.edgeAy[i] = edgeA.y;
        lines.slopeA[i] = edgeA.slope;
        lines.edgeBx[i] = edgeB.x;
        lines.edgeBy[i] = edgeB.y;
        lines.slopeB[i] = edgeB.slope;
        lines.isRound[i] = c.isRound;
        lines.radius[i] = widestRadius(c, p, f.focal);
        const bool isFine = (segmentErrorCode(s) <= node.errorCode) | ((segmentOctants(s) & node.octantMask) != 0u);
        lines.keep[i] = (isFine & (p.isThere > 0.5f)) ? 1u : 0u;
    }
    const float width = float(f.width), height = float(f.height);
    for (size_t i = 0; i < count; ++i) {
        if (lines.keep[i] == 0) continue;
        const float xa = lines.xa[i], ya = lines.ya[i], xb = lines.xb[i], yb = lines.yb[i];
        const RibbonEdge a{lines.edgeAx[i], lines.edgeAy[i], lines.slopeA[i]},
            b{lines.edgeBx[i], lines.edgeBy[i], lines.slopeB[i]};
        const bool isTubeHere = lines.isRound[i] > 0.5f;
        const float widest =
            isTubeHere ? lines.radius[i] : std::sqrt(max(a.x * a.x + a.y * a.y, b.x * b.x + b.y * b.y));
        if (max(xa, xb) < -widest || max(ya, yb) < -widest || min(xa, xb) >= width + widest ||
            min(ya, yb) >= height + widest)
            continue;
        const uint32_t id = kKindStrand | (firstId + uint32_t(i));
        if (lines.radius[i] >= f.exactStrands) {
            const WideStrand s{xa,
                               ya,
                               xb,
                               yb,
                               lines.inverseA[i],
                               lines.inverseB[i],
                               lines.halfA[i],
                               lines.halfB[i],
                               lines.nearerA[i],
                               lines.nearerB[i],
                               a,
                               b,
                               widest,
                               isTubeHere,
                               id};
            // One that covers much of the image is work for all threads.
            const float rows = std::fabs(yb - ya) + 2 * widest, columns = std::fabs(xb - xa) + 2 * widest;
            if (min(rows, height) * min(columns, width) > float(kLargePixels))
                wide.keep(wide.context, s);
            else
                fillStrand(f, s, 0, int(f.height) - 1, visibility);
            continue;
        }
        const float dx = std::fabs(xb - xa), dy = std::fabs(yb - ya);
        if (dx >= dy)
            drawLine(f, lines, i, {xa, ya, xb, yb, f.width, 1, f.width, f.height}, id, visibility);
        else
            drawLine(f, lines, i, {ya, xa, yb, xb, f.height, f.width, 1, f.width}, id, visibility);
        // Every vertex as a point: a segment that is seen along its axis has no line.
        const auto point = [&](float x, float y, float inverse, float half, float nearer) {
            if (!(x >= 0 && y >= 0 && x < width && y < height)) return;
            const uint32_t pixel = uint32_t(int(y)) * f.width + uint32_t(int(x));
            const float dot_ = 3.14159265f * half * half * (1.0f - max(dx, dy) / max(2.0f * half, 1.0e-6f));
            if (half < kNarrow && coverageThreshold(pixel, ~id, f.coverageSeed) >= dot_) return;
            offer(visibility, pixel, inverse / nearer, id);
        };
        point(xa, ya, lines.inverseA[i], lines.halfA[i], lines.nearerA[i]);
        point(xb, yb, lines.inverseB[i], lines.halfB[i], lines.nearerB[i]);
    }
}

void fillWide(const FrameConstants& frame, const WideStrand* strands, size_t count, uint32_t firstRow, uint32_t lastRow,
              uint64_t* visibility) {
    const FrameConstants f = frame;
    for (size_t i = 0; i < count; ++i) fillStrand(f, strands[i], int(firstRow), int(lastRow), visibility);
}

/// Segments of the pixels of a row, in camera space.
struct StrandEnds {
    alignas(64) float ax[kTile], ay[kTile], az[kTile], bx[kTile], by[kTile], bz[kTile];
    alignas(64) float dax[kTile], day[kTile], daz[kTile], dbx[kTile], dby[kTile], dbz[kTile];
    alignas(64) float ra[kTile], rb[kTile], isRound[kTile];
    alignas(64) uint32_t colourA[kTile], colourB[kTile];
};
struct StrandTexels {
    alignas(64) float depth[kTile], radius[kTile], thickness[kTile], x[kTile], y[kTile], perpX[kTile], perpY[kTile],
        red[kTile], green[kTile], blue[kTile], isRound[kTile], axisX[kTile], axisY[kTile];
};

/// Texels of the pixels that show strands.
void resolveStrands(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, uint32_t x0, uint32_t y,
                    TexelRow& __restrict row, float& largestRadius) {
    StrandEnds e;
    StrandTexels o;
    const size_t n = p.count;
    for (size_t i = 0; i < n; ++i) {
        const StrandBlock& block = in.strandBlocks[p.id[i] / kSegmentsPerBlock];
        const StrandSegment& s = block.segments[p.id[i] % kSegmentsPerBlock];
        const CameraSegment c = cameraSegment(*block.node, s);
        e.ax[i] = c.a.x;
        e.ay[i] = c.a.y;
        e.az[i] = c.a.z;
        e.bx[i] = c.b.x;
        e.by[i] = c.b.y;
        e.bz[i] = c.b.z;
        e.dax[i] = c.directionA.x;
        e.day[i] = c.directionA.y;
        e.daz[i] = c.directionA.z;
        e.dbx[i] = c.directionB.x;
        e.dby[i] = c.directionB.y;
        e.dbz[i] = c.directionB.z;
        e.ra[i] = c.radiusA;
        e.rb[i] = c.radiusB;
        e.isRound[i] = c.isRound;
        e.colourA[i] = s.a.colour;
        e.colourB[i] = s.b.colour;
        if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
            const vec3 d = f.debugView == kDebugLevel ? debugLevelColour(block.node->level)
                                                      : debugErrorColour(block.node->errorPixels);
            const auto byte = [](float l) { return uint32_t(int(srgbFromLinear(l) * 255.0f + 0.5f)); };
            e.colourA[i] = e.colourB[i] = byte(d.x) | byte(d.y) << 8 | byte(d.z) << 16;
        }
    }
    const float focal = f.focal, cx = f.centre.x - float(int(x0)) - 0.5f, cy = f.centre.y - float(int(y)) - 0.5f;
    const float nearPlane = f.nearPlane, support = f.supportScale;
    const vec3 sun = f.sunDirection;
    const float exactStrands = f.exactStrands;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        CameraSegment s;
        s.a = vec3(e.ax[i], e.ay[i], e.az[i]);
        s.b = vec3(e.bx[i], e.by[i], e.bz[i]);
        s.radiusA = e.ra[i];
        s.radiusB = e.rb[i];
        s.directionA = vec3(e.dax[i], e.day[i], e.daz[i]);
        s.directionB = vec3(e.dbx[i], e.dby[i], e.dbz[i]);
        s.isRound = e.isRound[i];
        const float px = float(int(p.pixel[i]));
        // Image coordinates from this pixel's centre on, so that the low bits are kept.
        const ScreenSegment on = projectSegment(s.a, s.b, focal, cx - px, cy, nearPlane);
        const StrandPixel seen = strandPixel(s, on, support, focal, cx - px, cy, nearPlane, exactStrands, sun);
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
        const auto mix = [&](uint32_t shift) {
            const float a = linearFromByte(float(int(e.colourA[i] >> shift & 255u)) * (1.0f / 255.0f));
            const float b = linearFromByte(float(int(e.colourB[i] >> shift & 255u)) * (1.0f / 255.0f));
            return a + place * (b - a);
        };
        o.red[i] = mix(0);
        o.green[i] = mix(8);
        o.blue[i] = mix(16);
    }
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
    }
}
