// Wide ribbons and tubes of the cpu backend: every pixel whose ray meets them. Included by curves.inl.

constexpr float kHullMargin = 0.02f;  ///< px: by how much corners of ribbons are off

// Whatever the numbers are, also if they are none, loops over pixels stay inside the image.
[[gnu::always_inline]] inline int pixelWithin(float v, float least, float most) {
    return int(min(max(least, v), most));
}

/// Is a box beside the picture, does it cover much of it? (1 or 0, as conditions would keep GCC from SIMD.)
[[gnu::always_inline]] inline float isBesidePicture(float left, float right, float top, float bottom, float width,
                                                    float height) {
    return max(max(left >= width ? 1.0f : 0.0f, top >= height ? 1.0f : 0.0f),
               max(right < 0.0f ? 1.0f : 0.0f, bottom < 0.0f ? 1.0f : 0.0f));
}
[[gnu::always_inline]] inline float isLargeBox(float left, float right, float top, float bottom, float width,
                                               float height) {
    return min(bottom - top, height) * min(right - left, width) > float(kLargePixels) ? 1.0f : 0.0f;
}

/// Pixels that a curve may take, of all its rows: most are a few pixels wide, and side by side they are one group.
struct FilledPixels {
    static constexpr uint32_t kMost = 256, kStretch = 8;
    alignas(64) uint32_t at[kMost + kTexelGroup];  ///< y 16 | x 16
    alignas(64) uint32_t depth[kMost + kTexelGroup];
    uint32_t count = 0;
};

/// Adds the first kStretch pixels of a row from `left` to `right`, but for those that show what is nearer than `least`,
/// a key.
[[gnu::always_inline]] inline void addStretch(const Visibility& visibility, uint32_t width, int y, int left, int right,
                                              uint64_t least, FilledPixels& to) {
    const uint32_t length = uint32_t(right - left) + 1u,
                   lanes = length < FilledPixels::kStretch ? length : FilledPixels::kStretch;
    to.count += keepFrom(visibility.keys + size_t(y) * width + size_t(left), lanes, least,
                         uint32_t(y) << 16 | uint32_t(left), to.at + to.count);
}

/// Offers those that were added; `depthOf`: where a pixel's ray meets the curve, bits or kPassedBy.
template <typename DepthOf>
[[gnu::always_inline]] inline void offerFilled(const FrameConstants& f, uint64_t id, const Visibility& visibility,
                                               FilledPixels& pixels, const DepthOf& depthOf) {
    const Lens lens = lensHere(f.focal);
    const float inverseFocal = 1.0f / f.focal, cx = f.centre.x, cy = f.centre.y;
    const uint32_t n = pixels.count;
    for (uint32_t k = 0; k < kTexelGroup; ++k) pixels.at[n + k] = pixels.at[0];  // groups are whole
    for (uint32_t first = 0; first < n; first += kTexelGroup) {
        const uint32_t* __restrict const at = pixels.at + first;
        uint32_t* __restrict const depth = pixels.depth + first;
#pragma GCC ivdep
        for (size_t k = 0; k < kTexelGroup; ++k) {
            const float x = float(int(at[k] & 0xffffu)) + 0.5f, y = float(int(at[k] >> 16)) + 0.5f;
            depth[k] = depthOf(pixelRay(lens, (x - cx) * inverseFocal, (y - cy) * inverseFocal));
        }
    }
    for (uint32_t k = 0; k < n; ++k) {
        if (pixels.depth[k] == kPassedBy) continue;
        const size_t pixel = size_t(pixels.at[k] >> 16) * f.width + size_t(pixels.at[k] & 0xffffu);
        offerKey(visibility, pixel, visibilityKey(pixels.depth[k], id));
    }
    pixels.count = 0;
}

/// Columns of a group of rows that a curve may cover.
constexpr uint32_t kRowGroup = 16;
struct FilledRows {
    alignas(64) int left[kRowGroup], right[kRowGroup];
};

/// Every pixel of rows [first, last] whose ray meets a curve. `rowsFrom(y, rows)`: its columns from a row on;
/// `nearest`: bits of a depth that none of it is nearer than.
template <typename RowsFrom, typename DepthOf>
[[gnu::always_inline]] inline void fillRowsOf(const FrameConstants& f, uint64_t id, int first, int last,
                                              uint32_t nearest, const Visibility& visibility, const RowsFrom& rowsFrom,
                                              const DepthOf& depthOf) {
    const uint64_t least = visibilityKey(nearest, 0u);
    FilledPixels pixels;
    FilledRows rows;
    for (int y0 = first; y0 <= last; y0 += int(kRowGroup)) {
        rowsFrom(y0, rows);
        const int count = last - y0 + 1 < int(kRowGroup) ? last - y0 + 1 : int(kRowGroup);
        for (int r = 0; r < count; ++r)
            for (int x = rows.left[r]; x <= rows.right[r]; x += int(FilledPixels::kStretch)) {
                addStretch(visibility, f.width, y0 + r, x, rows.right[r], least, pixels);
                if (pixels.count > FilledPixels::kMost - FilledPixels::kStretch)
                    offerFilled(f, id, visibility, pixels, depthOf);
            }
    }
    if (pixels.count > 0) offerFilled(f, id, visibility, pixels, depthOf);
}

/// Bits of a bound of depths: of the least one, less what rounding may be off.
inline uint32_t nearestBits(float depth, float slack) {
    const float least = depth - slack;
    return least > 0.0f ? floatBitsToUint(least) : 0u;
}

/// A line between two corners of a ribbon, px: its convex hull lies between all of them.
struct HullLine {
    float top, bottom, x, slope, least, most;
};
constexpr size_t kHullLines = 6, kHullFrom[kHullLines] = {0, 0, 0, 1, 1, 2}, kHullTo[kHullLines] = {1, 2, 3, 2, 3, 3};
[[gnu::always_inline]] inline HullLine hullLine(float xa, float ya, float xb, float yb) {
    const bool isDown = ya <= yb;
    HullLine h;
    h.top = isDown ? ya : yb;
    h.bottom = isDown ? yb : ya;
    h.x = isDown ? xa : xb;
    h.slope = ((isDown ? xb : xa) - h.x) / max(h.bottom - h.top, 1.0e-6f);
    h.least = min(xa, xb);
    h.most = max(xa, xb);
    return h;
}
/// Columns of the hull between two heights, as one line has them.
[[gnu::always_inline]] inline void lineColumns(const HullLine& h, float top, float bottom, float& from, float& to) {
    const float y0 = max(h.top, top), y1 = min(h.bottom, bottom);
    const bool isFlat = h.bottom - h.top < 2.0f * kHullMargin;  // its slope says nothing
    const float x0 = h.x + (y0 - h.top) * h.slope, x1 = h.x + (y1 - h.top) * h.slope;
    const float lo = isFlat ? h.least : min(x0, x1), hi = isFlat ? h.most : max(x0, x1);
    const bool isThere = y0 <= y1;
    from = min(from, isThere ? lo : from);
    to = max(to, isThere ? hi : to);
}
/// Columns of a group of rows from `firstRow` on.
[[gnu::always_inline]] inline void hullRows(const HullLine* lines, float width, int firstRow,
                                            FilledRows& __restrict rows) {
    static_assert(kHullLines == 6, "all of them are here");
    const HullLine a = lines[0], b = lines[1], c = lines[2], d = lines[3], e = lines[4], g = lines[5];
#pragma GCC ivdep
    for (size_t r = 0; r < kRowGroup; ++r) {
        const float cy = float(firstRow + int(r)) + 0.5f, top = cy - kHullMargin, bottom = cy + kHullMargin;
        float from = 3.0e38f, to = -3.0e38f;
        lineColumns(a, top, bottom, from, to);
        lineColumns(b, top, bottom, from, to);
        lineColumns(c, top, bottom, from, to);
        lineColumns(d, top, bottom, from, to);
        lineColumns(e, top, bottom, from, to);
        lineColumns(g, top, bottom, from, to);
        rows.left[r] = pixelWithin(std::ceil(from - 0.5f - kHullMargin), 0.0f, width);
        rows.right[r] = pixelWithin(to - 0.5f + kHullMargin, -1.0f, width - 1.0f);
    }
}

/// What all pixels of a ribbon need. Its corners are those of the picture where one of its own has no place on it.
struct PlacedRibbon {
    Ribbon ribbon;
    float x[4], y[4];  ///< px
};
[[gnu::always_inline]] inline PlacedRibbon placeRibbon(const FrameConstants& f, const CameraSegment& c) {
    PlacedRibbon w;
    w.ribbon = ribbonOf(c.a, c.b, c.directionA, c.directionB, c.radiusA, c.radiusB);
    const Lens lens = lensHere(f.focal);
    float isBefore = 1.0f;  // (a number: see pushTexel)
    const auto corner = [&](float end, float side, float& x, float& y) {
        const vec3 at = ribbonCorner(w.ribbon, end, side);
        const float scale = f.focal / lensDepth(lens, max(at.z, f.nearPlane));
        x = at.x * scale + f.centre.x;
        y = at.y * scale + f.centre.y;
        isBefore *= (kOrthographic ? 1.0f : (at.z > f.nearPlane ? 1.0f : 0.0f)) *
                    (std::fabs(x) < kCurveGuard ? 1.0f : 0.0f) * (std::fabs(y) < kCurveGuard ? 1.0f : 0.0f);
    };
    corner(0.0f, -1.0f, w.x[0], w.y[0]);
    corner(0.0f, 1.0f, w.x[1], w.y[1]);
    corner(1.0f, -1.0f, w.x[2], w.y[2]);
    corner(1.0f, 1.0f, w.x[3], w.y[3]);
    const float width = float(int(f.width)), height = float(int(f.height));
    const float reaches = curveReaches(c, lens, f.centre.x, f.centre.y, width, height, f.nearPlane);
    const bool isOwn = isBefore > 0.5f;
    const float lowest = reaches < 0.5f ? 0.0f : height;
    w.x[0] = isOwn ? w.x[0] : 0.0f;
    w.x[1] = isOwn ? w.x[1] : width;
    w.x[2] = isOwn ? w.x[2] : 0.0f;
    w.x[3] = isOwn ? w.x[3] : width;
    w.y[0] = isOwn ? w.y[0] : 0.0f;
    w.y[1] = isOwn ? w.y[1] : 0.0f;
    w.y[2] = isOwn ? w.y[2] : lowest;
    w.y[3] = isOwn ? w.y[3] : lowest;
    return w;
}
[[gnu::always_inline]] inline float leastOf(const float* v) { return min(min(v[0], v[1]), min(v[2], v[3])); }
[[gnu::always_inline]] inline float mostOf(const float* v) { return max(max(v[0], v[1]), max(v[2], v[3])); }
[[gnu::always_inline]] inline int firstRowOf(const float* y, float first, float last) {
    return pixelWithin(std::ceil(leastOf(y) - 0.5f - kHullMargin), first, last + 1.0f);
}
[[gnu::always_inline]] inline int lastRowOf(const float* y, float first, float last) {
    return pixelWithin(mostOf(y) - 0.5f + kHullMargin, first - 1.0f, last);
}
/// Bits of a depth than which no hit of a ribbon is nearer.
[[gnu::always_inline]] inline uint32_t nearestOf(const Ribbon& r) {
    const float a = r.a.z - std::fabs(r.w.z), b = r.a.z + r.along.z - std::fabs(r.w.z + r.turn.z);
    const float least = min(a, b) * r.unit;
    // A hit may lie kRibbonSlack beyond an edge: ten times that holds what rounding adds, too.
    return nearestBits(least, 10.0f * kRibbonSlack * r.unit + kRibbonSlack * std::fabs(least));
}

/// Pixels of rows [first, last]; `rowsFrom` as of fillRowsOf.
template <typename RowsFrom>
[[gnu::always_inline]] inline void fillRibbonRows(const FrameConstants& f, const Ribbon& of, uint64_t id, int first,
                                                  int last, const Visibility& visibility, const RowsFrom& rowsFrom) {
    const Ribbon ribbon = of;
    const float nearPlane = f.nearPlane;
    fillRowsOf(f, id, first, last, nearestOf(ribbon), visibility, rowsFrom,
               [&](const PixelRay& ray) __attribute__((always_inline)) {
                   const RibbonHit hit = ribbonHit(ribbon, ray, nearPlane, kRibbonSlack);
                   return hit.depth < kNoRibbon ? floatBitsToUint(hit.depth) : kPassedBy;
               });
}

/// Rows [firstRow, lastRow] of a ribbon so large that they are shared out.
void fillRibbon(const FrameConstants& f, const FilledCurve& s, int firstRow, int lastRow,
                const Visibility& visibility) {
    HullLine lines[kHullLines];
    for (size_t k = 0; k < kHullLines; ++k)
        lines[k] = hullLine(s.x[kHullFrom[k]], s.y[kHullFrom[k]], s.x[kHullTo[k]], s.y[kHullTo[k]]);
    const float width = float(int(f.width));
    fillRibbonRows(f, s.ribbon, s.id, firstRowOf(s.y, float(firstRow), float(lastRow)),
                   lastRowOf(s.y, float(firstRow), float(lastRow)), visibility,
                   [&](int y, FilledRows& rows) { hullRows(lines, width, y, rows); });
}

/// Rows of a tube. Between the boxes of both ends lie boxes, of which a row meets those from u = lo to hi.
void tubeRows(const FilledCurve& s, float width, int firstRow, FilledRows& __restrict rows) {
    const float top = s.top[0], bottom = s.bottom[0], dTop = s.top[1] - top, dBottom = s.bottom[1] - bottom;
    const float left0 = s.left[0], left1 = s.left[1], right0 = s.right[0], right1 = s.right[1];
    // Which of both borders lies below lo or above hi: 1 or 0, as conditions would keep GCC from SIMD.
    const bool hasTop = std::fabs(dTop) > 1.0e-6f, hasBottom = std::fabs(dBottom) > 1.0e-6f;
    const float overTop = hasTop ? dTop : 1.0f, overBottom = hasBottom ? dBottom : 1.0f;
    const float topHigh = hasTop && dTop > 0.0f ? 1.0f : 0.0f, topLow = hasTop ? 1.0f - topHigh : 0.0f;
    const float bottomLow = hasBottom && dBottom > 0.0f ? 1.0f : 0.0f, bottomHigh = hasBottom ? 1.0f - bottomLow : 0.0f;
#pragma GCC ivdep
    for (size_t r = 0; r < kRowGroup; ++r) {
        const float cy = float(firstRow + int(r));
        const float atTop = min(max((cy - top) / overTop, 0.0f), 1.0f);
        const float atBottom = min(max((cy - bottom) / overBottom, 0.0f), 1.0f);
        const float lo = max(topLow * atTop, bottomLow * atBottom);
        const float hi = min(topHigh * atTop + (1.0f - topHigh), bottomHigh * atBottom + (1.0f - bottomHigh));
        const float leftLo = left0 + lo * (left1 - left0), leftHi = left0 + hi * (left1 - left0);
        const float rightLo = right0 + lo * (right1 - right0), rightHi = right0 + hi * (right1 - right0);
        rows.left[r] = pixelWithin(std::ceil(min(leftLo, leftHi)), 0.0f, width);
        rows.right[r] = pixelWithin(max(rightLo, rightHi), -1.0f, width - 1.0f);
    }
}

/// Rows [firstRow, lastRow] of a wide tube: every pixel whose ray meets it.
template <bool isPlain>
void fillTubeRows(const FrameConstants& f, const FilledCurve& s, int firstRow, int lastRow,
                  const Visibility& visibility) {
    const int first = pixelWithin(std::ceil(min(s.top[0], s.top[1])), float(firstRow), float(lastRow) + 1.0f),
              last = pixelWithin(max(s.bottom[0], s.bottom[1]), float(firstRow) - 1.0f, float(lastRow));
    const Tube tube = s.tube;
    const float nearPlane = f.nearPlane, width = float(int(f.width));
    const float za = tube.a.z - tube.radiusA, zb = tube.b.z - tube.radiusB;
    const float size = std::fabs(tube.a.z) + std::fabs(tube.b.z) + tube.radiusA + tube.radiusB;
    // (Places along rays are found from where the ends lie, far to the side or not: za, oa and q of tubeHit round about
    // 3e-7 of that.)
    const float aside = std::fabs(tube.a.x) + std::fabs(tube.a.y) + std::fabs(tube.b.x) + std::fabs(tube.b.y);
    fillRowsOf(
        f, s.id, first, last, nearestBits(min(za, zb), 1.0e-4f * size + 1.0e-6f * aside), visibility,
        [&](int y, FilledRows& rows) { tubeRows(s, width, y, rows); },
        [&](const PixelRay& ray) __attribute__((always_inline)) {
            const TubeHit hit = tubeHit(tube, ray, nearPlane, isPlain);
            return hit.depth < kNoDepth ? floatBitsToUint(hit.depth) : kPassedBy;
        });
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
