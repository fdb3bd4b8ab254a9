// Triangles of a few pixels, 16 of them side by side: what raster.inl draws of one, to the last bit of the keys.
// Included by kernels.inl, after raster.inl.

/// Given: corners as they are seen, 1/256 px, and imageLinear. Found: the pixels of those whose boxes are at most kSide
/// wide and high in the picture, and less than kSmallSteps altogether (32 bits hold their products), and which are left
/// to raster.inl.
struct SmallTriangles {
    static constexpr size_t kCount = 16;
    static constexpr int kSide = 8;
    alignas(64) int32_t x[3][kCount], y[3][kCount];
    alignas(64) float inverse[3][kCount];
    alignas(64) uint32_t isGiven[kCount];              ///< 0 or 1
    alignas(64) int32_t isClipped[kCount];             ///< not 0: corners are nowhere
    alignas(64) uint32_t isLeft[kCount];               ///< 1: larger, or to be clipped
    alignas(64) int32_t fromX[kCount], fromY[kCount];  ///< the first pixel of the box
    alignas(64) int32_t spanX[kCount], spanY[kCount];  ///< to the last one; -1: nothing is drawn here
    alignas(64) int32_t edge[3][kCount], edgeX[3][kCount], edgeY[3][kCount];  ///< at a row's pixel, and what a px adds
    alignas(64) float z[3][kCount], moved[kCount];
    alignas(64) uint32_t hits[2][kCount];  ///< of the lower and the upper half of the box, a bit for each pixel
    alignas(64) float depth[kSide * kSide][kCount];
};
/// The largest box of those that are drawn here, and whether any is left.
struct SmallBoxes {
    int across, up;
    bool isAnyLeft;
};

[[gnu::always_inline]] inline int leastOf(int a, int b) { return a < b ? a : b; }
[[gnu::always_inline]] inline int mostOf(int a, int b) { return a > b ? a : b; }

SmallBoxes findSmallBoxes(const FrameConstants& f, SmallTriangles& __restrict t) {
    constexpr int kLast = SmallTriangles::kSide - 1, kMostSteps = int(kSmallSteps) - 1;
    const int right = static_cast<int>(f.width) - 1, bottom = static_cast<int>(f.height) - 1;
    int mostX = -1, mostY = -1;
    uint32_t anyLeft = 0;
#pragma GCC ivdep
    for (size_t i = 0; i < SmallTriangles::kCount; ++i) {
        const int x0 = t.x[0][i], x1 = t.x[1][i], x2 = t.x[2][i], y0 = t.y[0][i], y1 = t.y[1][i], y2 = t.y[2][i];
        const int minX = leastOf(leastOf(x0, x1), x2), maxX = mostOf(mostOf(x0, x1), x2);
        const int minY = leastOf(leastOf(y0, y1), y2), maxY = mostOf(mostOf(y0, y1), y2);
        // First and last pixel whose centre lies in the box, and in the picture.
        const int fromX = mostOf(0, (minX + 127) >> 8), spanX = leastOf(right, (maxX - 128) >> 8) - fromX;
        const int fromY = mostOf(0, (minY + 127) >> 8), spanY = leastOf(bottom, (maxY - 128) >> 8) - fromY;
        const uint32_t isEmpty = uint32_t(spanX | spanY) >> 31;
        // (Of the whole triangle too: what reaches far beyond the picture may show but a few pixels of it.)
        const int roomX = kMostSteps - (maxX - minX), roomY = kMostSteps - (maxY - minY);
        const uint32_t isLarge = uint32_t((kLast - spanX) | (kLast - spanY) | roomX | roomY) >> 31;
        const uint32_t isClipped = t.isClipped[i] != 0 ? 1u : 0u;
        const uint32_t isLeft = t.isGiven[i] & (isClipped | (isLarge & (isEmpty ^ 1u)));
        const uint32_t isSmall = t.isGiven[i] & ((isClipped | isLarge | isEmpty) ^ 1u);
        const int none = int(isSmall) - 1;  // all bits where nothing is drawn here
        t.isLeft[i] = isLeft;
        t.fromX[i] = fromX;
        t.fromY[i] = fromY;
        t.spanX[i] = spanX | none;
        t.spanY[i] = spanY | none;
        anyLeft |= isLeft;
        mostX = mostOf(mostX, spanX | none);
        mostY = mostOf(mostY, spanY | none);
    }
    return {mostX + 1, mostY + 1, anyLeft != 0};
}

/// As edgesOf() has them, at the first pixel of each box. Triangles have two sides.
void findSmallEdges(SmallTriangles& __restrict t) {
#pragma GCC ivdep
    for (size_t i = 0; i < SmallTriangles::kCount; ++i) {
        const int isSmall = ~(t.spanX[i] >> 31);  // all bits, or none: products of other corners have no room
        const int cx = t.fromX[i] * 256 + 128, cy = t.fromY[i] * 256 + 128;
        const int x0 = (t.x[0][i] - cx) & isSmall, y0 = (t.y[0][i] - cy) & isSmall;
        const int xa = (t.x[1][i] - cx) & isSmall, ya = (t.y[1][i] - cy) & isSmall;
        const int xb = (t.x[2][i] - cx) & isSmall, yb = (t.y[2][i] - cy) & isSmall;
        const int signedArea = (xa - x0) * (yb - y0) - (ya - y0) * (xb - x0);
        const bool isTurned = signedArea < 0;
        const int x1 = isTurned ? xb : xa, y1 = isTurned ? yb : ya, x2 = isTurned ? xa : xb, y2 = isTurned ? ya : yb;
        const float ia = t.inverse[1][i], ib = t.inverse[2][i];
        const float i1 = isTurned ? ib : ia, i2 = isTurned ? ia : ib;
        const int area = isTurned ? -signedArea : signedArea;
        const float inverseArea = 1.0f / float(mostOf(area, 1));
        const float z0 = t.inverse[0][i] * inverseArea, z1 = i1 * inverseArea, z2 = i2 * inverseArea;
        // Edge e lies opposite corner e.
        const int ex0 = x2 - x1, ey0 = y2 - y1, ex1 = x0 - x2, ey1 = y0 - y2, ex2 = x1 - x0, ey2 = y1 - y0;
        const int m0 = isTopLeft(ex0, ey0) ? 0 : 1, m1 = isTopLeft(ex1, ey1) ? 0 : 1, m2 = isTopLeft(ex2, ey2) ? 0 : 1;
        t.edge[0][i] = ey0 * x1 - ex0 * y1 - m0;
        t.edge[1][i] = ey1 * x2 - ex1 * y2 - m1;
        t.edge[2][i] = ey2 * x0 - ex2 * y0 - m2;
        t.edgeX[0][i] = -ey0 * 256;
        t.edgeX[1][i] = -ey1 * 256;
        t.edgeX[2][i] = -ey2 * 256;
        t.edgeY[0][i] = ex0 * 256;
        t.edgeY[1][i] = ex1 * 256;
        t.edgeY[2][i] = ex2 * 256;
        t.z[0][i] = z0;
        t.z[1][i] = z1;
        t.z[2][i] = z2;
        t.moved[i] = (m0 != 0 ? z0 : 0.0f) + (m1 != 0 ? z1 : 0.0f) + (m2 != 0 ? z2 : 0.0f);
        t.spanX[i] |= area == 0 ? -1 : 0;
        t.hits[0][i] = t.hits[1][i] = 0;
    }
}

/// Is the pixel (x, y) of each box in its triangle, and how deep?
[[gnu::always_inline]] inline void stepSmall(SmallTriangles& __restrict t, int x, int y) {
    const int at = SmallTriangles::kSide * y + x, bit = at % 32;
    float* __restrict const depth = t.depth[at];
    uint32_t* __restrict const hits = t.hits[at / 32];
#pragma GCC ivdep
    for (size_t i = 0; i < SmallTriangles::kCount; ++i) {
        const int w0 = t.edge[0][i] + x * t.edgeX[0][i], w1 = t.edge[1][i] + x * t.edgeX[1][i],
                  w2 = t.edge[2][i] + x * t.edgeX[2][i];
        const float linear = float(w0) * t.z[0][i] + float(w1) * t.z[1][i] + float(w2) * t.z[2][i] + t.moved[i];
        depth[i] = depthOfLinear(lensHere(1.0f), linear);
        const uint32_t isIn = uint32_t(~(w0 | w1 | w2 | (t.spanX[i] - x) | (t.spanY[i] - y))) >> 31;
        hits[i] |= isIn << bit;
    }
}

/// Draws those whose boxes are small. `idOf(i)`: draw id of triangle i.
template <typename IdOf>
[[gnu::always_inline]] inline void fillSmall(const FrameConstants& f, SmallTriangles& t, const SmallBoxes& boxes,
                                             const Visibility& visibility, const IdOf& idOf) {
    if (boxes.across == 0 || boxes.up == 0) return;
    findSmallEdges(t);
    for (int y = 0; y < boxes.up; ++y) {
        for (int x = 0; x < boxes.across; ++x) stepSmall(t, x, y);
        for (size_t i = 0; i < SmallTriangles::kCount; ++i) {
            t.edge[0][i] += t.edgeY[0][i];
            t.edge[1][i] += t.edgeY[1][i];
            t.edge[2][i] += t.edgeY[2][i];
        }
    }
    for (size_t i = 0; i < SmallTriangles::kCount; ++i) {
        const size_t first = static_cast<size_t>(t.fromY[i]) * f.width + static_cast<size_t>(t.fromX[i]);
        const uint64_t id = idOf(i);
        for (uint64_t left = t.hits[0][i] | uint64_t{t.hits[1][i]} << 32; left != 0; left &= left - 1) {
            const auto at = static_cast<uint32_t>(__builtin_ctzll(left));
            const size_t pixel = first + at / SmallTriangles::kSide * f.width + at % SmallTriangles::kSide;
            offerKey(visibility, pixel, visibilityKey(floatBitsToUint(t.depth[at][i]), id));
        }
    }
}
