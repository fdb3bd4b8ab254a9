// Ambient occlusion (shaders/shared/occlusion.h), row by row of the pixels that it is asked of. Included by
// kernels.inl, once per instruction set.

/// What one side of a slice meets. (x, y): the place's pixel of the planes.
struct HorizonSearch {
    const float* __restrict depth;
    Lens lens;
    float inverseFocal, edge, inverseEdge, centreX, centreY;
    int lastX, lastY, pitch;
    [[gnu::always_inline]] AoSide step(AoSide side, const AoPlace& a, uint number, float x, float y, float dx, float dy,
                                       float start) const {
        const float far = aoStep(number, start) * a.pixels * inverseEdge;
        // Floors of what may lie before the picture, but not by as much as kBefore.
        constexpr int kBefore = 512;
        const int qx = int(x + 0.5f + dx * far + float(kBefore)) - kBefore;
        const int qy = int(y + 0.5f + dy * far + float(kBefore)) - kBefore;
        const int aboveX = qx < 0 ? 0 : qx, aboveY = qy < 0 ? 0 : qy;
        const int inX = aboveX > lastX ? lastX : aboveX, inY = aboveY > lastY ? lastY : aboveY;
        const float z = depth[inY * pitch + inX];
        const float isInside = (inX == qx ? 1.0f : 0.0f) * (inY == qy ? 1.0f : 0.0f);
        const float isThere = z > 0.0f ? isInside : 0.0f;
        const vec3 q = alongRay(pixelRay(lens, (float(inX) * edge + 0.5f - centreX) * inverseFocal,
                                         (float(inY) * edge + 0.5f - centreY) * inverseFocal),
                                z);
        return aoRaised(side, a, q, isThere);
    }
    /// All steps, written out: a loop within a loop does not become SIMD.
    [[gnu::always_inline]] float operator()(const AoPlace& a, AoSide side, float x, float y, float dx, float dy,
                                            float start) const {
        static_assert(kAoSteps == 2);
        side = step(side, a, 0, x, y, dx, dy, start);
        return step(side, a, 1, x, y, dx, dy, start).hidden;
    }
};

/// Where nothing is seen nothing is hidden.
[[gnu::always_inline]] inline bool isEmptyRun(const float* __restrict depth, uint32_t n) {
    float most = 0.0f;
    for (size_t i = 0; i < n; ++i) most = max(most, depth[i]);
    return !(most > 0.0f);
}

void occludeRow(const FrameConstants& frame, const AoPlanes& of, uint32_t x0, uint32_t y, uint32_t n) {
    const FrameConstants f = frame;
    const size_t first = of.at(x0, y);
    float* const __restrict out = of.open + first;
    const float* const __restrict depth = of.depth + first;
    const uint32_t* const __restrict normal = of.normal + first;
    if (isEmptyRun(depth, n)) {
        for (size_t i = 0; i < n; ++i) out[i] = 1.0f;
        return;
    }
    alignas(64) float cosine[kTile], sine[kTile], start[kTile];
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t number = aoNumber((x0 + i) & 3u, y & 3u);
        cosine[i] = of.cosine[number];
        sine[i] = of.sine[number];
        start[i] = aoStart(number);
    }
    const Lens lens = lensHere(f.focal);
    const float edge = float(int(of.edge)), radius = of.radius, left = float(int(x0)), row = float(int(y));
    const HorizonSearch search{of.depth + of.at(0, 0),
                               lens,
                               1.0f / f.focal,
                               edge,
                               1.0f / edge,
                               f.centre.x,
                               f.centre.y,
                               int(of.width) - 1,
                               int(of.height) - 1,
                               int(of.pitch)};
    const float py = row * edge + 0.5f - f.centre.y;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float x = left + float(int(i)), z = depth[i];
        const AoPlace a =
            aoPlace(lens, x * edge + 0.5f - f.centre.x, py, z > 0.0f ? z : 1.0f, octDecode(normal[i]), radius);
        const float c = cosine[i], s = sine[i];
        const AoSide along = aoSide(a, c, s), aside = aoSide(a, -s, c);
        const float hidden =
            search(a, along, x, row, c, s, start[i]) + search(a, aoBack(along), x, row, -c, -s, start[i]) +
            search(a, aside, x, row, -s, c, start[i]) + search(a, aoBack(aside), x, row, s, -c, start[i]);
        out[i] = z > 0.0f ? 1.0f - 0.5f * a.share * hidden : 1.0f;
    }
}

/// A sum of what is of one surface.
struct OpenSum {
    float open, weights;
};
[[gnu::always_inline]] inline OpenSum aoAdded(OpenSum s, float weight, float open) {
    s.open += weight * open;
    s.weights += weight;
    return s;
}

/// The mean over the pattern along one axis, within the surface; `pace`: to the next along it.
template <bool isDown>
[[gnu::always_inline]] inline void aoMeanAlong(const FrameConstants& f, const AoPlanes& of,
                                               const float* __restrict depth, const uint32_t* __restrict normal,
                                               const float* __restrict from, float* __restrict to, uint32_t x0,
                                               uint32_t y, uint32_t n) {
    const Lens lens = lensHere(f.focal);
    const float edge = float(int(of.edge)), radius = of.radius, centreX = f.centre.x;
    const float py = float(int(y)) * edge + 0.5f - f.centre.y, left = float(int(x0));
    const ptrdiff_t pace = isDown ? ptrdiff_t{of.pitch} : 1;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float z = depth[i], px = (left + float(int(i))) * edge + 0.5f - centreX;
        const vec2 slopes = aoSlope(lens, px, py, octDecode(normal[i]));
        const float slope = (isDown ? slopes.y : slopes.x) * edge;
        const float tolerance = aoTolerance(lens, z, radius);
        const auto weight = [=](float other, int k) {
            return aoShare(k) * aoWeight(lens, z, other, float(k) * slope, tolerance);
        };
        static_assert(kAoReach == 2);
        OpenSum s{0.0f, 0.0f};
        s = aoAdded(s, weight(depth[ptrdiff_t(i) - 2 * pace], -2), from[ptrdiff_t(i) - 2 * pace]);
        s = aoAdded(s, weight(depth[ptrdiff_t(i) - pace], -1), from[ptrdiff_t(i) - pace]);
        s = aoAdded(s, weight(depth[i], 0), from[i]);
        s = aoAdded(s, weight(depth[ptrdiff_t(i) + pace], 1), from[ptrdiff_t(i) + pace]);
        s = aoAdded(s, weight(depth[ptrdiff_t(i) + 2 * pace], 2), from[ptrdiff_t(i) + 2 * pace]);
        to[i] = s.weights > 0.0f ? s.open / s.weights : 1.0f;
    }
}
void aoMeanRow(const FrameConstants& frame, const AoPlanes& of, bool isDown, uint32_t x0, uint32_t y, uint32_t n) {
    const FrameConstants f = frame;
    const size_t first = of.at(x0, y);
    const float* const depth = of.depth + first;
    const float* const from = (isDown ? of.mean : of.open) + first;
    float* const to = (isDown ? of.open : of.mean) + first;
    if (isEmptyRun(depth, n)) {
        for (size_t i = 0; i < n; ++i) to[i] = 1.0f;
        return;
    }
    if (isDown)
        aoMeanAlong<true>(f, of, depth, of.normal + first, from, to, x0, y, n);
    else
        aoMeanAlong<false>(f, of, depth, of.normal + first, from, to, x0, y, n);
}

/// Pixels of one row of the picture that are `edge` apart, from (x0, y) on.
template <bool isBetweenX, bool isBetweenY>
[[gnu::always_inline]] inline void aoSpreadAlong(const FrameConstants& f, const AoPlanes& of,
                                                 const float* __restrict ownDepth, const uint32_t* __restrict ownNormal,
                                                 uint32_t x0, uint32_t y, uint32_t n, float* __restrict out) {
    const Lens lens = lensHere(f.focal);
    const uint32_t edge = of.edge;
    const size_t first = of.at(x0 / edge, y / edge), below = first + of.pitch;
    const float* const __restrict depth = of.depth + first;
    const float* const __restrict open = of.open + first;
    const float* const __restrict depthBelow = of.depth + below;
    const float* const __restrict openBelow = of.open + below;
    const float size = float(int(edge)), radius = of.radius, px0 = float(int(x0)) + 0.5f - f.centre.x,
                py = float(int(y)) + 0.5f - f.centre.y;
    const float dx = isBetweenX ? -1.0f : 0.0f, dy = isBetweenY ? -1.0f : 0.0f;
    constexpr float kShare = (isBetweenX ? 0.5f : 1.0f) * (isBetweenY ? 0.5f : 1.0f);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float z = ownDepth[i];
        const vec2 slope = aoSlope(lens, px0 + size * float(int(i)), py, octDecode(ownNormal[i]));
        const float tolerance = aoTolerance(lens, z, radius);
        const auto weight = [=](float other, float offX, float offY) {
            return kShare * aoWeight(lens, z, other, slope.x * offX + slope.y * offY, tolerance);
        };
        OpenSum s{kAoOpenWeight * tolerance, kAoOpenWeight * tolerance};
        s = aoAdded(s, weight(depth[i], dx, dy), open[i]);
        if (isBetweenX) s = aoAdded(s, weight(depth[i + 1], dx + size, dy), open[i + 1]);
        if (isBetweenY) s = aoAdded(s, weight(depthBelow[i], dx, dy + size), openBelow[i]);
        if (isBetweenX && isBetweenY) s = aoAdded(s, weight(depthBelow[i + 1], dx + size, dy + size), openBelow[i + 1]);
        out[i] = z > 0.0f ? s.open / s.weights : 1.0f;
    }
}
void aoSpreadRow(const FrameConstants& frame, const AoPlanes& of, const float* depth, const uint32_t* normal,
                 uint32_t x0, uint32_t y, uint32_t n, float* out) {
    const FrameConstants f = frame;
    const bool isBetweenX = x0 % of.edge != 0, isBetweenY = y % of.edge != 0;
    if (isBetweenX && isBetweenY)
        aoSpreadAlong<true, true>(f, of, depth, normal, x0, y, n, out);
    else if (isBetweenX)
        aoSpreadAlong<true, false>(f, of, depth, normal, x0, y, n, out);
    else if (isBetweenY)
        aoSpreadAlong<false, true>(f, of, depth, normal, x0, y, n, out);
    else
        aoSpreadAlong<false, false>(f, of, depth, normal, x0, y, n, out);
}
