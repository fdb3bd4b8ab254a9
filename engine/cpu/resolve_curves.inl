// Texels of the pixels that show ribbons and tubes. Included by kernels.inl.

/// Segments as stored, and their nodes, side by side: of runs of pixels, or one for each pixel.
struct CurveSegments {
    alignas(64) uint32_t words[8][kSpreadRow];
    alignas(64) float base[3][kSpreadRow], axes[9][kSpreadRow], edge[kSpreadRow];
};
[[gnu::always_inline]] inline CurveSegment packedOf(const CurveSegments& e, size_t i) {
    return {{e.words[0][i], e.words[1][i], e.words[2][i], e.words[3][i]},
            {e.words[4][i], e.words[5][i], e.words[6][i], e.words[7][i]}};
}
[[gnu::always_inline]] inline DrawNode nodeOf(const CurveSegments& e, size_t i) {
    DrawNode node{};
    node.base = vec3(e.base[0][i], e.base[1][i], e.base[2][i]);
    node.axisX = vec3(e.axes[0][i], e.axes[1][i], e.axes[2][i]);
    node.axisY = vec3(e.axes[3][i], e.axes[4][i], e.axes[5][i]);
    node.axisZ = vec3(e.axes[6][i], e.axes[7][i], e.axes[8][i]);
    node.edge = e.edge[i];
    return node;
}

/// Runs of pixels that show the same segment: a leaf is some wide.
struct CurveRuns : PixelRuns {
    alignas(64) uint32_t kind[kTile];
    CurveSegments segments;
};
constexpr uint32_t kThinCurve = 0, kFilledRibbon = 1, kFilledTube = 2, kCurveKinds = 3;

/// Pixels of a kind.
struct CurvesOfKind {
    uint32_t count = 0;
    alignas(64) uint32_t from[kSpreadRow];  ///< places in the row's list
    CurveSegments segments;
};
struct CurveTexels {
    alignas(64) float depth[kTile], radius[kTile], thickness[kTile], x[kTile], y[kTile], perpX[kTile], perpY[kTile],
        red[kTile], green[kTile], blue[kTile], isRound[kTile], axisX[kTile], axisY[kTile];
};

/// Follows the pointers.
void gatherRuns(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, CurveRuns& to) {
    constexpr uint32_t kAhead = 8;  // segments lie anywhere in memory
    CurveSegments& e = to.segments;
    const auto ask = [&](uint32_t r) {
        const uint32_t id = p.id[to.first[r]];
        const CurveBlock& block = in.curveBlocks[id / kSegmentsPerBlock];
        __builtin_prefetch(block.segments + id % kSegmentsPerBlock);
        __builtin_prefetch(block.node);
    };
    for (uint32_t r = 0; r < to.count && r < kAhead; ++r) ask(r);
    for (uint32_t r = 0; r < to.count; ++r) {
        if (r + kAhead < to.count) ask(r + kAhead);
        const uint32_t id = p.id[to.first[r]];
        const CurveBlock& block = in.curveBlocks[id / kSegmentsPerBlock];
        const uint32_t* const words = &block.segments[id % kSegmentsPerBlock].a.positionXY;
        const DrawNode& node = *block.node;
        for (size_t k = 0; k < 8; ++k) e.words[k][r] = words[k];
        e.base[0][r] = node.base.x;
        e.base[1][r] = node.base.y;
        e.base[2][r] = node.base.z;
        const float* const axes = &node.axisX.x;
        for (size_t k = 0; k < 9; ++k) e.axes[k][r] = axes[k];
        e.edge[r] = node.edge;
        if (f.debugView == kDebugLevel || f.debugView == kDebugError) {
            const vec3 d =
                f.debugView == kDebugLevel ? debugLevelColour(node.level) : debugErrorColour(node.errorPixels);
            const auto byte = [](float l) { return uint32_t(int(srgbFromLinear(l) * 255.0f + 0.5f)); };
            e.words[3][r] = e.words[7][r] = byte(d.x) | byte(d.y) << 8 | byte(d.z) << 16;
        }
    }
}

/// Which of them are filled, as when they were drawn.
void findKinds(const FrameConstants& f, CurveRuns& runs) {
    const size_t n = runs.count;
    const CurveSegments& e = runs.segments;
    uint32_t* __restrict const kind = runs.kind;
    const Lens lens = lensHere(f.focal);
    const float cx = f.centre.x, cy = f.centre.y, nearPlane = f.nearPlane, exactCurves = f.exactCurves;
#pragma GCC ivdep
    for (size_t r = 0; r < n; ++r) {
        const CameraSegment s = cameraSegment(nodeOf(e, r), packedOf(e, r));
        const float filled = isFilled(s, projectSegment(s.a, s.b, lens, cx, cy, nearPlane), lens, exactCurves);
        kind[r] = uint32_t(int(filled * (float(kFilledRibbon) + s.isRound * float(kFilledTube - kFilledRibbon))));
    }
}

/// One entry for each pixel of the runs, by kind: kinds are worked on one after the other.
void spreadRuns(const CurveRuns& runs, CurvesOfKind* kinds) {
    const CurveSegments& e = runs.segments;
    for (uint32_t r = 0; r < runs.count; ++r) {
        CurvesOfKind& to = kinds[runs.kind[r]];
        CurveSegments& t = to.segments;
        const uint32_t first = runs.first[r], length = runs.first[r + 1] - first;
        for (uint32_t at = 0; at < length; at += kSpread) {
            const size_t entry = to.count + at;
            for (size_t k = 0; k < kSpread; ++k) to.from[entry + k] = first + at + uint32_t(k);
            for (size_t w = 0; w < 8; ++w) spread(e.words[w][r], t.words[w] + entry);
            for (size_t w = 0; w < 3; ++w) spread(e.base[w][r], t.base[w] + entry);
            for (size_t w = 0; w < 9; ++w) spread(e.axes[w][r], t.axes[w] + entry);
            spread(e.edge[r], t.edge + entry);
        }
        to.count += length;
    }
}

/// One of a segment's colours, linear, at a place from 0 to 1.
[[gnu::always_inline]] inline float mixedColour(const CurveSegment& s, uint32_t shift, float place) {
    const float a = linearFromByte(float(int(s.a.colour >> shift & 255u)) * (1.0f / 255.0f));
    const float b = linearFromByte(float(int(s.b.colour >> shift & 255u)) * (1.0f / 255.0f));
    return a + place * (b - a);
}

/// Filled tubes or filled ribbons, by the rays of their pixels. (ex0, ey): the row's first pixel, px from the principal
/// point, over the focal length. Where rounding lets a ray pass by it is as deep as it was drawn.
template <uint32_t kind>
void resolveFilled(const FrameConstants& f, const CurvesOfKind& of, const WinningPixels& p, float ex0, float ey,
                   CurveTexels& __restrict o) {
    const size_t n = of.count;
    const CurveSegments& e = of.segments;
    const uint32_t* __restrict const from = of.from;
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const Lens lens = lensHere(f.focal);
#pragma GCC ivdep
    for (size_t k = 0; k < n; ++k) {
        const CurveSegment packed = packedOf(e, k);
        const CameraSegment s = cameraSegment(nodeOf(e, k), packed);
        const float drawn = p.depth[from[k]];
        const PixelRay ray = pixelRay(lens, ex0 + float(int(p.pixel[from[k]])) * inverseFocal, ey);
        FilledPixel seen;
        if constexpr (kind == kFilledTube)
            seen = tubePixel(s, ray, nearPlane);
        else
            seen = ribbonPixel(s, ray, nearPlane);
        const bool isHit = seen.depth < kNoDepth;
        o.depth[k] = isHit ? seen.depth : drawn;
        o.radius[k] = 0.25f;
        o.thickness[k] = kind == kFilledTube ? 0.25f : kLeafThickness * 0.25f;  // a filled ribbon is a leaf
        o.x[k] = o.y[k] = 0.0f;
        o.perpX[k] = isHit ? seen.normalPerp.x : 0.0f;
        o.perpY[k] = isHit ? seen.normalPerp.y : 0.0f;
        o.isRound[k] = o.axisX[k] = o.axisY[k] = 0.0f;
        o.red[k] = mixedColour(packed, 0, seen.place);
        o.green[k] = mixedColour(packed, 8, seen.place);
        o.blue[k] = mixedColour(packed, 16, seen.place);
    }
}

/// Those that are drawn as lines. (cx, cy): the principal point from the row's first pixel's centre on.
void resolveThin(const FrameConstants& f, const CurvesOfKind& of, const WinningPixels& p, float cx, float cy,
                 CurveTexels& __restrict o) {
    const size_t n = of.count;
    const CurveSegments& e = of.segments;
    const uint32_t* __restrict const from = of.from;
    const float nearPlane = f.nearPlane, support = f.supportScale;
    const Lens lens = lensHere(f.focal);
    const vec3 sun = f.sunDirection;
#pragma GCC ivdep
    for (size_t k = 0; k < n; ++k) {
        const CurveSegment packed = packedOf(e, k);
        const CameraSegment s = cameraSegment(nodeOf(e, k), packed);
        const float px = float(int(p.pixel[from[k]]));
        // Image coordinates from this pixel's centre on, so that the low bits are kept.
        const ScreenSegment on = projectSegment(s.a, s.b, lens, cx - px, cy, nearPlane);
        const CurvePixel seen = curvePixel(s, on, support, lens, cx - px, cy, nearPlane, sun);
        const Texel t = seen.texel;
        const float place = seen.place;
        o.depth[k] = t.depth;
        o.radius[k] = t.radius;
        o.thickness[k] = t.thickness;
        o.x[k] = t.offset.x;
        o.y[k] = t.offset.y;
        o.perpX[k] = t.normalPerp.x;
        o.perpY[k] = t.normalPerp.y;
        o.isRound[k] = t.isRound;
        o.axisX[k] = t.axis.x;
        o.axisY[k] = t.axis.y;
        o.red[k] = mixedColour(packed, 0, place);
        o.green[k] = mixedColour(packed, 8, place);
        o.blue[k] = mixedColour(packed, 16, place);
    }
}

/// Into the row; is any of them a tube to be reconstructed?
bool placeTexels(const CurveTexels& o, const CurvesOfKind& of, const WinningPixels& p, TexelRow& __restrict row,
                 float& largestRadius) {
    float round_ = 0, largest = largestRadius;
    for (size_t k = 0; k < of.count; ++k) {
        const size_t at = kPad + p.pixel[of.from[k]];
        row.depth[at] = o.depth[k];
        row.radius[at] = o.radius[k];
        row.thickness[at] = o.thickness[k];
        row.x[at] = o.x[k];
        row.y[at] = o.y[k];
        row.perpX[at] = o.perpX[k];
        row.perpY[at] = o.perpY[k];
        row.red[at] = o.red[k];
        row.green[at] = o.green[k];
        row.blue[at] = o.blue[k];
        row.isRound[at] = o.isRound[k];
        row.axisX[at] = o.axisX[k];
        row.axisY[at] = o.axisY[k];
        largest = max(largest, o.radius[k]);
        round_ = max(round_, max(o.isRound[k], o.axisX[k] > kAllRibbon ? 1.0f : 0.0f));
    }
    largestRadius = largest;
    return round_ > 0.0f;
}

/// Texels of the pixels that show curves; is any of them a tube to be reconstructed?
bool resolveCurves(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, uint32_t x0, uint32_t y,
                   TexelRow& __restrict row, float& largestRadius) {
    CurveRuns runs;
    CurvesOfKind kinds[kCurveKinds];
    CurveTexels o;
    findRuns(p, runs);
    gatherRuns(f, in, p, runs);
    findKinds(f, runs);
    spreadRuns(runs, kinds);
    const float cx = f.centre.x - float(int(x0)) - 0.5f, cy = f.centre.y - float(int(y)) - 0.5f;
    const float ex0 = -cx / f.focal, ey = -cy / f.focal;
    bool hasTubes = false;
    if (kinds[kThinCurve].count > 0) {
        resolveThin(f, kinds[kThinCurve], p, cx, cy, o);
        hasTubes = placeTexels(o, kinds[kThinCurve], p, row, largestRadius);
    }
    if (kinds[kFilledTube].count > 0) {
        resolveFilled<kFilledTube>(f, kinds[kFilledTube], p, ex0, ey, o);
        placeTexels(o, kinds[kFilledTube], p, row, largestRadius);
    }
    if (kinds[kFilledRibbon].count > 0) {
        resolveFilled<kFilledRibbon>(f, kinds[kFilledRibbon], p, ex0, ey, o);
        placeTexels(o, kinds[kFilledRibbon], p, row, largestRadius);
    }
    return hasTubes;
}
