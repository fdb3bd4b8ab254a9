// Wide ribbons and tubes of the cpu backend: every pixel whose ray meets them. Included by curves.inl.

constexpr float kHullMargin = 0.02f;  ///< px: by how much corners of ribbons are off

// Whatever the numbers are, also if they are none, loops over pixels stay inside the image.
[[gnu::always_inline]] inline int pixelWithin(float v, float least, float most) {
    return int(min(max(least, v), most));
}

/// Lines between the corners of a ribbon, px: its convex hull lies between them.
struct HullLines {
    float top[6], bottom[6], x[6], slope[6], least[6], most[6];
};
HullLines hullLines(const FilledCurve& s) {
    constexpr size_t kFrom[6] = {0, 0, 0, 1, 1, 2}, kTo[6] = {1, 2, 3, 2, 3, 3};
    HullLines h;
    for (size_t k = 0; k < 6; ++k) {
        const bool isDown = s.y[kFrom[k]] <= s.y[kTo[k]];
        const size_t i = isDown ? kFrom[k] : kTo[k], j = isDown ? kTo[k] : kFrom[k];
        h.top[k] = s.y[i];
        h.bottom[k] = s.y[j];
        h.x[k] = s.x[i];
        h.slope[k] = (s.x[j] - s.x[i]) / max(s.y[j] - s.y[i], 1.0e-6f);
        h.least[k] = min(s.x[i], s.x[j]);
        h.most[k] = max(s.x[i], s.x[j]);
    }
    return h;
}
/// Columns of the hull between two heights.
void hullColumns(const HullLines& h, float top, float bottom, float& from, float& to) {
    for (size_t k = 0; k < 6; ++k) {
        const float y0 = max(h.top[k], top), y1 = min(h.bottom[k], bottom);
        const bool isFlat = h.bottom[k] - h.top[k] < 2.0f * kHullMargin;  // its slope says nothing
        const float x0 = h.x[k] + (y0 - h.top[k]) * h.slope[k], x1 = h.x[k] + (y1 - h.top[k]) * h.slope[k];
        const float lo = isFlat ? h.least[k] : min(x0, x1), hi = isFlat ? h.most[k] : max(x0, x1);
        const bool isThere = y0 <= y1;
        from = min(from, isThere ? lo : from);
        to = max(to, isThere ? hi : to);
    }
}

/// Rows [firstRow, lastRow] of a wide ribbon: every pixel whose ray meets it.
void fillRibbon(const FrameConstants& f, const FilledCurve& s, int firstRow, int lastRow,
                const Visibility& visibility) {
    constexpr int kRibbonStretch = 8;  // most ribbons are a few pixels wide
    const int first = pixelWithin(std::ceil(min(min(s.y[0], s.y[1]), min(s.y[2], s.y[3])) - 0.5f - kHullMargin),
                                  float(firstRow), float(lastRow) + 1.0f),
              last = pixelWithin(max(max(s.y[0], s.y[1]), max(s.y[2], s.y[3])) - 0.5f + kHullMargin,
                                 float(firstRow) - 1.0f, float(lastRow));
    const Ribbon ribbon = s.ribbon;
    const HullLines hull = hullLines(s);
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const Lens lens = lensHere(f.focal);
    for (int y = first; y <= last; ++y) {
        const float cy = float(y) + 0.5f, ey = (cy - f.centre.y) * inverseFocal;
        float from = 3.0e38f, to = -3.0e38f;
        hullColumns(hull, cy - kHullMargin, cy + kHullMargin, from, to);
        const int left = pixelWithin(std::ceil(from - 0.5f - kHullMargin), 0.0f, float(int(f.width))),
                  right = pixelWithin(to - 0.5f + kHullMargin, -1.0f, float(int(f.width)) - 1.0f);
        for (int x0 = left; x0 <= right; x0 += kRibbonStretch) {
            alignas(64) uint32_t depth[kRibbonStretch], keep[kRibbonStretch];
            const int count = right - x0 + 1 < kRibbonStretch ? right - x0 + 1 : kRibbonStretch;
            const float ex0 = float(x0) + 0.5f - f.centre.x;
#pragma GCC ivdep
            for (size_t k = 0; k < kRibbonStretch; ++k) {
                const RibbonHit hit = ribbonHit(ribbon, pixelRay(lens, (ex0 + float(int(k))) * inverseFocal, ey),
                                                nearPlane, kRibbonSlack);
                depth[k] = floatBitsToUint(hit.depth);
                keep[k] = hit.depth < kNoRibbon ? 1u : 0u;
            }
            const size_t firstPixel = size_t(y) * f.width + size_t(x0);
            for (int k = 0; k < count; ++k)
                if (keep[k] != 0) offerKey(visibility, firstPixel + size_t(k), visibilityKey(depth[k], s.id));
        }
    }
}

/// Rows [firstRow, lastRow] of a wide tube: every pixel whose ray meets it.
template <bool isPlain>
void fillTubeRows(const FrameConstants& f, const FilledCurve& s, int firstRow, int lastRow,
                  const Visibility& visibility) {
    constexpr int kTubeStretch = 8;  // most tubes are a few pixels wide
    const int first = pixelWithin(std::ceil(min(s.top[0], s.top[1])), float(firstRow), float(lastRow) + 1.0f),
              last = pixelWithin(max(s.bottom[0], s.bottom[1]), float(firstRow) - 1.0f, float(lastRow));
    const Tube tube = s.tube;
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const Lens lens = lensHere(f.focal);
    for (int y = first; y <= last; ++y) {
        // Between the boxes of both ends lie boxes, of which the row meets those from u = lo to hi.
        const float cy = float(y);
        const float dTop = s.top[1] - s.top[0], dBottom = s.bottom[1] - s.bottom[0];
        float lo = 0.0f, hi = 1.0f;
        if (std::fabs(dTop) > 1.0e-6f) (dTop > 0.0f ? hi : lo) = min(max((cy - s.top[0]) / dTop, 0.0f), 1.0f);
        if (std::fabs(dBottom) > 1.0e-6f) {
            const float at = min(max((cy - s.bottom[0]) / dBottom, 0.0f), 1.0f);
            if (dBottom > 0.0f)
                lo = max(lo, at);
            else
                hi = min(hi, at);
        }
        const auto mix = [](const float* v, float u) { return v[0] + u * (v[1] - v[0]); };
        const int left = pixelWithin(std::ceil(min(mix(s.left, lo), mix(s.left, hi))), 0.0f, float(int(f.width))),
                  right = pixelWithin(max(mix(s.right, lo), mix(s.right, hi)), -1.0f, float(int(f.width)) - 1.0f);
        const float ey = (cy + 0.5f - f.centre.y) * inverseFocal;
        for (int x0 = left; x0 <= right; x0 += kTubeStretch) {
            alignas(64) uint32_t depth[kTubeStretch], keep[kTubeStretch];
            const int count = right - x0 + 1 < kTubeStretch ? right - x0 + 1 : kTubeStretch;
            const float ex0 = float(x0) + 0.5f - f.centre.x;
#pragma GCC ivdep
            for (size_t k = 0; k < kTubeStretch; ++k) {
                const TubeHit hit =
                    tubeHit(tube, pixelRay(lens, (ex0 + float(int(k))) * inverseFocal, ey), nearPlane, isPlain);
                depth[k] = floatBitsToUint(hit.depth);
                keep[k] = hit.depth < kNoDepth ? 1u : 0u;
            }
            const size_t firstPixel = size_t(y) * f.width + size_t(x0);
            for (int k = 0; k < count; ++k)
                if (keep[k] != 0) offerKey(visibility, firstPixel + size_t(k), visibilityKey(depth[k], s.id));
        }
    }
}

void fillTube(const FrameConstants& f, const FilledCurve& s, int firstRow, int lastRow, const Visibility& visibility) {
    if (isBeforeEye(s.tube, f.nearPlane) && isShort(s.tube))
        fillTubeRows<true>(f, s, firstRow, lastRow, visibility);
    else
        fillTubeRows<false>(f, s, firstRow, lastRow, visibility);
}

void fillCurve(const FrameConstants& f, const FilledCurve& s, int firstRow, int lastRow, const Visibility& visibility) {
    if (s.isRound)
        fillTube(f, s, firstRow, lastRow, visibility);
    else
        fillRibbon(f, s, firstRow, lastRow, visibility);
}

/// A tube that is to be filled, and the pixels around its ends. One that reaches beside the eye has one box.
FilledCurve wideTube(const FrameConstants& f, const CameraSegment& c, uint64_t id) {
    FilledCurve w{};
    w.isRound = true;
    w.id = id;
    w.tube = tubeOf(c.a, c.b, c.radiusA, c.radiusB);
    const vec3 ends[2] = {c.a, c.b};
    const float radii[2] = {c.radiusA, c.radiusB};
    const Lens lens = lensHere(f.focal);
    const bool isBefore = kOrthographic || (c.a.z > 1.0001f * c.radiusA &&
                                            c.b.z > 1.0001f * c.radiusB);  // both have an outline of their own
    for (size_t k = 0; k < 2; ++k) {
        const size_t l = isBefore ? k : 0, m = isBefore ? k : 1;
        const auto slope = [&](float sign, float vec3::*axis) {
            return sign * tubeSlope(lens, sign * (ends[l].*axis), ends[l].z, radii[l], sign * (ends[m].*axis),
                                    ends[m].z, radii[m]);
        };
        w.left[k] = slope(-1.0f, &vec3::x) * f.focal + f.centre.x - 0.51f;  // of pixels' centres, rounded
        w.right[k] = slope(1.0f, &vec3::x) * f.focal + f.centre.x - 0.49f;
        w.top[k] = slope(-1.0f, &vec3::y) * f.focal + f.centre.y - 0.51f;
        w.bottom[k] = slope(1.0f, &vec3::y) * f.focal + f.centre.y - 0.49f;
    }
    return w;
}

/// A ribbon that is to be filled, and its corners: those of the picture where one of its own has no place on it.
FilledCurve wideRibbon(const FrameConstants& f, const CameraSegment& c, uint64_t id) {
    FilledCurve w{};
    w.id = id;
    w.ribbon = ribbonOf(c.a, c.b, c.directionA, c.directionB, c.radiusA, c.radiusB);
    const Lens lens = lensHere(f.focal);
    bool isBefore = true;
    for (size_t k = 0; k < 4; ++k) {
        const vec3 corner = ribbonCorner(w.ribbon, k < 2 ? 0.0f : 1.0f, k % 2 == 0 ? -1.0f : 1.0f);
        const float scale = f.focal / lensDepth(lens, max(corner.z, f.nearPlane));
        w.x[k] = corner.x * scale + f.centre.x;
        w.y[k] = corner.y * scale + f.centre.y;
        isBefore = isBefore && (kOrthographic || corner.z > f.nearPlane) && std::fabs(w.x[k]) < kCurveGuard &&
                   std::fabs(w.y[k]) < kCurveGuard;
    }
    const float width = float(int(f.width)), height = float(int(f.height));
    const float reaches = curveReaches(c, lens, f.centre.x, f.centre.y, width, height, f.nearPlane);
    for (size_t k = 0; k < 4 && !isBefore; ++k) {
        w.x[k] = k % 2 == 0 ? 0.0f : width;
        w.y[k] = k < 2 || reaches < 0.5f ? 0.0f : height;
    }
    return w;
}
