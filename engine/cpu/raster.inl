// Triangles of the cpu backend: coverage into the visibility buffer, and corners back out of it. Included by
// kernels.inl, once per instruction set.

template <typename T>
[[gnu::always_inline]] inline void exchange(T& a, T& b) {
    const T c = a;
    a = b;
    b = c;
}

/// Camera-space position of a cluster's vertex.
[[gnu::always_inline]] inline vec3 placeOf(const MeshBlock& block, uint32_t i) {
    const DrawMesh& m = *block.mesh;
    const MeshVertex& v = block.vertices[i];
    if (m.places == kPlacesShort) return meshPosition(v.x, v.y, v.z, m);
    if (m.places == kPlacesFar) return meshPositionWide(v.x, v.y, v.z, v.x >> 31, v.y >> 31, v.z >> 31, m);
    const MeshVertex& high = block.vertices[i + (block.counts & 0xffffu) / 2];
    return meshPositionWide(v.x, v.y, v.z, high.x, high.y, high.z, m);
}

/// A triangle in fixed point, oriented so that its inside is positive.
struct Fixed {
    int64_t x[3], y[3];
    float inverseDepth[3];  // imageLinear
    uint64_t id;
};

[[gnu::always_inline]] inline void offerKey(const Visibility& visibility, size_t pixel, uint64_t key) {
    // Builtins: std::atomic_ref would be a function of its own, see kernels.inl.
    uint8_t* const run = &visibility.runs[pixel >> Visibility::kRunBits];
    if (__atomic_load_n(run, __ATOMIC_RELAXED) == 0) __atomic_store_n(run, uint8_t{1}, __ATOMIC_RELAXED);
    uint64_t* const entry = &visibility.keys[pixel];
    uint64_t old = __atomic_load_n(entry, __ATOMIC_RELAXED);
    while (key < old && !__atomic_compare_exchange_n(entry, &old, key, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
    }
}

/// Pixels of a row of a triangle with an alpha mask that are in front, before it is known whether they are cut out.
struct MaskedRow {
    uint32_t count = 0;
    alignas(64) int x[kTile];
    alignas(64) uint32_t isKept[kTile];
    alignas(64) float alpha[kTile];
    UvRow uv;
    uint64_t key[kTile];
};

constexpr int64_t kSmallSteps = 40 * 256;           ///< triangles up to this wide are filled in 32 bits
constexpr int64_t kLargePixels = int64_t{1} << 14;  ///< from this many pixels on a triangle is shared out by rows

/// What of a triangle's box is filled, px, and whether 32 bits are enough for it.
struct FillBox {
    int fromX, toX, fromY, toY;
    bool isSmall;
};
[[gnu::always_inline]] inline FillBox fillBox(const FrameConstants& f, const Fixed& t, int firstRow, int lastRow) {
    const auto least = [](const int64_t* v) {
        return v[0] < v[1] ? (v[0] < v[2] ? v[0] : v[2]) : (v[1] < v[2] ? v[1] : v[2]);
    };
    const auto most = [](const int64_t* v) {
        return v[0] > v[1] ? (v[0] > v[2] ? v[0] : v[2]) : (v[1] > v[2] ? v[1] : v[2]);
    };
    const int64_t minX = least(t.x), maxX = most(t.x), minY = least(t.y), maxY = most(t.y);
    // First and last pixel whose centre lies in the box.
    FillBox box;
    box.fromX = static_cast<int>((minX + 127) >> 8 < 0 ? 0 : (minX + 127) >> 8);
    box.toX = static_cast<int>((maxX - 128) >> 8 >= f.width ? f.width - 1 : (maxX - 128) >> 8);
    const int fromY = static_cast<int>((minY + 127) >> 8), toY = static_cast<int>((maxY - 128) >> 8);
    box.fromY = fromY < firstRow ? firstRow : fromY;
    box.toY = toY > lastRow ? lastRow : toY;
    box.isSmall = maxX - minX < kSmallSteps && maxY - minY < kSmallSteps;
    return box;
}

/// What a triangle's pixels need. `Number`: holds twice the area of the triangle and the box that is filled, as a whole
/// number: 32 bits, or a double, which has room for all that clipTriangle leaves and, other than 64 bits, SIMD
/// everywhere.
template <typename Number>
struct TriangleEdges {
    Number dx[3], dy[3], row[3];  ///< edge e lies opposite corner e; `row`: at the first pixel of a row
    float z[3], moved;         ///< what a depth is made of, and what of it the fill rule has moved

    /// imageLinear of a pixel with these edges.
    [[gnu::always_inline]] float linearAt(Number w0, Number w1, Number w2) const {
        const float z0 = z[0], z1 = z[1], z2 = z[2];
        return static_cast<float>(w0) * z0 + static_cast<float>(w1) * z1 + static_cast<float>(w2) * z2 + moved;
    }
};
template <typename Number>
[[gnu::always_inline]] inline TriangleEdges<Number> edgesOf(const Fixed& t, int fromX, int fromY) {
    constexpr int kOne = 256, kHalf = 128;  // kSubpixel
    const int64_t cx = int64_t{fromX} * kOne + kHalf, cy = int64_t{fromY} * kOne + kHalf;
    TriangleEdges<Number> of;
    bool isMoved[3];  // by the fill rule, which decides on coverage only: depth takes that 1 back
    for (int e = 0; e < 3; ++e) {
        const int a = (e + 1) % 3, b = (e + 2) % 3;
        const int64_t ex = t.x[b] - t.x[a], ey = t.y[b] - t.y[a];
        of.dx[e] = static_cast<Number>(-ey * kOne);
        of.dy[e] = static_cast<Number>(ex * kOne);
        const int64_t at = ex * (cy - t.y[a]) - ey * (cx - t.x[a]);
        isMoved[e] = !isTopLeft(static_cast<int>(ex), static_cast<int>(ey));
        of.row[e] = static_cast<Number>(at - (isMoved[e] ? 1 : 0));
    }
    const int64_t area = (t.x[1] - t.x[0]) * (t.y[2] - t.y[0]) - (t.y[1] - t.y[0]) * (t.x[2] - t.x[0]);
    const float inverseArea = 1.0f / static_cast<float>(area);
    for (int e = 0; e < 3; ++e) of.z[e] = t.inverseDepth[e] * inverseArea;
    of.moved = (isMoved[0] ? of.z[0] : 0.0f) + (isMoved[1] ? of.z[1] : 0.0f) + (isMoved[2] ? of.z[2] : 0.0f);
    return of;
}

template <typename Number>
[[gnu::always_inline]] inline bool covers(Number w0, Number w1, Number w2) {
    const Number least = w0 < w1 ? w0 : w1;
    return (least < w2 ? least : w2) >= 0;
}

/// Pixels of a triangle in a box, kGroup of a row at once.
template <typename Number, int kGroup>
[[gnu::always_inline]] inline void fill(const Fixed& t, const FillBox& box, uint32_t stride,
                                        const Visibility& visibility) {
    const int fromX = box.fromX, toX = box.toX, toY = box.toY;
    TriangleEdges<Number> of = edgesOf<Number>(t, fromX, box.fromY);
    const Number dx0 = of.dx[0], dx1 = of.dx[1], dx2 = of.dx[2];
    for (int y = box.fromY; y <= toY; ++y) {
        Number row0 = of.row[0], row1 = of.row[1], row2 = of.row[2];
        if (y < toY)  // the next row is a picture's width away
            __builtin_prefetch(visibility.keys + static_cast<size_t>(y + 1) * stride + static_cast<size_t>(fromX), 1);
        for (int x0 = fromX; x0 <= toX;
             x0 += kGroup, row0 += kGroup * dx0, row1 += kGroup * dx1, row2 += kGroup * dx2) {
            // Edges are straight: both ends beyond one, all are.
            const auto isBeside = [](Number w, Number dx) { return w < 0 && w + (kGroup - 1) * dx < 0; };
            if (isBeside(row0, dx0) || isBeside(row1, dx1) || isBeside(row2, dx2)) continue;
            alignas(64) uint32_t depth[kGroup];
#pragma GCC ivdep
            for (int k = 0; k < kGroup; ++k) {
                const Number w0 = row0 + Number(k) * dx0, w1 = row1 + Number(k) * dx1, w2 = row2 + Number(k) * dx2;
                const float linear = of.linearAt(w0, w1, w2);
                depth[k] = covers(w0, w1, w2) ? floatBitsToUint(depthOfLinear(lensHere(1.0f), linear)) : kPassedBy;
            }
            const size_t first = static_cast<size_t>(y) * stride + static_cast<size_t>(x0);
            const uint32_t lanes = uint32_t(toX - x0 + 1 < kGroup ? toX - x0 + 1 : kGroup);
            for (uint32_t left = inFront(visibility.keys + first, lanes, depth, t.id); left != 0; left &= left - 1) {
                const auto k = static_cast<uint32_t>(__builtin_ctz(left));
                offerKey(visibility, first + k, visibilityKey(depth[k], t.id));
            }
        }
        for (int e = 0; e < 3; ++e) of.row[e] += of.dy[e];
    }
}

/// A triangle whose material has an alpha mask.
struct MaskInput {
    const TextureSet* textures;
    const SurfaceMaterial* material;
    const MeshVertex* vertices[3];
    vec3 corners[3];
};

void keepMasked(const FrameConstants& frame, const MaskInput& m, int y, MaskedRow& __restrict row) {
    const FrameConstants f = frame;
    const float inverseFocal = 1.0f / f.focal;
    const vec3 a = m.corners[0], b = m.corners[1], c = m.corners[2];
    const MeshVertex va = *m.vertices[0], vb = *m.vertices[1], vc = *m.vertices[2];
    const auto alphaOf = [](const MeshVertex& v) { return float(int(v.colour >> 24)) * (1.0f / 255.0f); };
    const float alphaA = alphaOf(va), alphaB = alphaOf(vb), alphaC = alphaOf(vc), all = m.material->alpha;
    const float ey = (float(y) + 0.5f - f.centre.y) * inverseFocal;
    const size_t n = row.count;
    UvRow& uv = row.uv;
    float* __restrict const alpha = row.alpha;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const PixelRay ray = pixelRay(lensHere(f.focal), (float(row.x[i]) + 0.5f - f.centre.x) * inverseFocal, ey);
        const vec2 w = triangleWeights(rayDirection(ray), fromRay(ray, a), fromRay(ray, b), fromRay(ray, c));
        const float wa = 1.0f - w.x - w.y;
        alpha[i] = all * (wa * alphaA + w.x * alphaB + w.y * alphaC);
        uv.u[i] = wa * va.u + w.x * vb.u + w.y * vc.u;
        uv.v[i] = wa * va.v + w.x * vb.v + w.y * vc.v;
        uv.footprint[i] = uvFootprint(ray, inverseFocal, a, vec3(b.x - a.x, b.y - a.y, b.z - a.z),
                                      vec3(c.x - a.x, c.y - a.y, c.z - a.z), vec2(vb.u - va.u, vb.v - va.v),
                                      vec2(vc.u - va.u, vc.v - va.v));
    }
    if (m.material->baseTexture.texture != 0) sampleAlphas(*m.textures, m.material->baseTexture, uv, 0, n, alpha);
    const float cutoff = m.material->alphaCutoff;
    for (size_t i = 0; i < n; ++i) row.isKept[i] = alpha[i] >= cutoff ? 1u : 0u;
}

/// Those of a triangle with an alpha mask.
template <typename Number>
[[gnu::always_inline]] inline void fillMasked(const FrameConstants& f, const Fixed& t, const FillBox& box,
                                              const Visibility& visibility, const MaskInput& mask) {
    TriangleEdges<Number> of = edgesOf<Number>(t, box.fromX, box.fromY);
    const size_t stride = f.width;
    MaskedRow masked;
    const auto offerMasked = [&](int y) {
        if (masked.count == 0) return;
        keepMasked(f, mask, y, masked);
        for (uint32_t i = 0; i < masked.count; ++i)
            if (masked.isKept[i] != 0u)
                offerKey(visibility, static_cast<size_t>(y) * stride + static_cast<size_t>(masked.x[i]), masked.key[i]);
        masked.count = 0;
    };
    for (int y = box.fromY; y <= box.toY; ++y) {
        Number w0 = of.row[0], w1 = of.row[1], w2 = of.row[2];
        for (int x = box.fromX; x <= box.toX; ++x) {
            if (covers(w0, w1, w2)) {
                const size_t pixel = static_cast<size_t>(y) * stride + static_cast<size_t>(x);
                const float linear = of.linearAt(w0, w1, w2);
                const uint64_t key = visibilityKey(floatBitsToUint(depthOfLinear(lensHere(1.0f), linear)), t.id);
                if (key < __atomic_load_n(&visibility.keys[pixel], __ATOMIC_RELAXED)) {
                    masked.x[masked.count] = x;
                    masked.key[masked.count++] = key;
                    if (masked.count == kTile) offerMasked(y);
                }
            }
            w0 += of.dx[0];
            w1 += of.dx[1];
            w2 += of.dx[2];
        }
        offerMasked(y);
        for (int e = 0; e < 3; ++e) of.row[e] += of.dy[e];
    }
}

/// Rows [firstRow, lastRow] of a triangle.
void fillRows(const FrameConstants& f, const Fixed& t, int firstRow, int lastRow, const Visibility& visibility) {
    const FillBox box = fillBox(f, t, firstRow, lastRow);
    if (box.fromX > box.toX || box.fromY > box.toY) return;
    constexpr int kNarrowGroup = 8;
    if (box.isSmall && box.toX - box.fromX < kNarrowGroup)
        fill<int32_t, kNarrowGroup>(t, box, f.width, visibility);
    else if (box.isSmall)
        fill<int32_t, 16>(t, box, f.width, visibility);
    else
        fill<double, 16>(t, box, f.width, visibility);
}
/// The same of one with an alpha mask.
void fillRowsMasked(const FrameConstants& f, const Fixed& t, int firstRow, int lastRow, const Visibility& visibility,
                    const MaskInput& mask) {
    const FillBox box = fillBox(f, t, firstRow, lastRow);
    if (box.fromX > box.toX || box.fromY > box.toY) return;
    if (box.isSmall)
        fillMasked<int32_t>(f, t, box, visibility, mask);
    else
        fillMasked<double>(f, t, box, visibility, mask);
}

/// What one triangle needs beside its corners.
struct Candidate {
    uint64_t id;
    bool isTwoSided;
    const MaskInput* mask;  ///< null: all of it counts
};

/// Fills a triangle or, where it is large, keeps it for later.
void takeTriangle(const FrameConstants& f, Fixed& t, const Candidate& of, const LargeSink& large,
                  const Visibility& visibility) {
    const int64_t area = (t.x[1] - t.x[0]) * (t.y[2] - t.y[0]) - (t.y[1] - t.y[0]) * (t.x[2] - t.x[0]);
    // Counter-clockwise in the scene is clockwise on a screen whose y points down: negative.
    if (area == 0 || (area > 0 && !of.isTwoSided)) return;
    if (area < 0) {
        exchange(t.x[1], t.x[2]);
        exchange(t.y[1], t.y[2]);
        exchange(t.inverseDepth[1], t.inverseDepth[2]);
    }
    const int last = static_cast<int>(f.height) - 1;
    if (of.mask != nullptr) {
        fillRowsMasked(f, t, 0, last, visibility, *of.mask);
    } else if ((area < 0 ? -area : area) > kLargePixels * 65536 * 2) {
        LargeTriangle l{};
        for (int k = 0; k < 3; ++k) {
            l.x[k] = static_cast<int32_t>(t.x[k]);
            l.y[k] = static_cast<int32_t>(t.y[k]);
            l.inverseDepth[k] = t.inverseDepth[k];
        }
        l.id = t.id;
        large.keep(large.context, l);
    } else {
        fillRows(f, t, 0, last, visibility);
    }
}

/// One vertex between a and b where the plane's distance is 0. The ends are put in one order first, so that both
/// triangles at an edge cut it at the same bits.
vec3 cutEdge(vec3 a, float da, vec3 b, float db) {
    if (a.x > b.x || (a.x == b.x && (a.y > b.y || (a.y == b.y && a.z > b.z)))) {
        exchange(a, b);
        exchange(da, db);
    }
    const float s = da / (da - db);
    return vec3(a.x + (b.x - a.x) * s, a.y + (b.y - a.y) * s, a.z + (b.z - a.z) * s);
}

/// Clips against the near plane and four planes far outside the image, then takes the fan.
void clipTriangle(const FrameConstants& f, const vec3* corner, const Candidate& of, const LargeSink& large,
                  const Visibility& visibility) {
    // Corners that are no numbers would be neither in nor out, and make more of themselves at every plane.
    for (int k = 0; k < 3; ++k)
        if (!(std::fabs(corner[k].x) + std::fabs(corner[k].y) + std::fabs(corner[k].z) < 1.0e30f)) return;
    vec3 polygon[12] = {corner[0], corner[1], corner[2]}, other[12];
    int count = 3;
    const float slope = (kGuardPixels - 16384.0f) / f.focal;
    const Lens lens = lensHere(f.focal);
    for (int plane = 0; plane < 5 && count >= 3; ++plane) {
        const auto distance = [&](const vec3& p) {
            const float w = lensDepth(lens, p.z);
            return plane == 0   ? p.z - f.nearPlane
                   : plane == 1 ? w * slope - p.x
                   : plane == 2 ? w * slope + p.x
                   : plane == 3 ? w * slope - p.y
                                : w * slope + p.y;
        };
        int kept = 0;
        for (int i = 0; i < count; ++i) {
            const vec3 &a = polygon[i], &b = polygon[(i + 1) % count];
            const float da = distance(a), db = distance(b);
            if (da >= 0) other[kept++] = a;
            if ((da >= 0) != (db >= 0)) {
                other[kept] = cutEdge(a, da, b, db);
                if (plane == 0) other[kept].z = f.nearPlane;  // exactly on it
                ++kept;
            }
        }
        for (int i = 0; i < kept; ++i) polygon[i] = other[i];
        count = kept;
    }
    if (count < 3) return;
    int64_t x[12], y[12];
    float inverse[12];
    for (int i = 0; i < count; ++i) {
        const float scale = f.focal / lensDepth(lens, polygon[i].z);
        // An edge's value: two products of an edge, which has both corners there, and a pixel's way from one of them.
        constexpr double kCorner = 131072.0, kSide = 16384.0, kSteps = 256.0;  // 2 kGuardPixels, a picture, kSubpixel
        static_assert(2.0 * (2.0 * kCorner * kSteps) * ((kCorner + kSide) * kSteps) < 0x1p53, "doubles hold it");
        const auto guarded = [](float p) { return min(max(-2.0f * kGuardPixels, p), 2.0f * kGuardPixels); };
        x[i] = snapPixel(guarded(polygon[i].x * scale + f.centre.x));
        y[i] = snapPixel(guarded(polygon[i].y * scale + f.centre.y));
        inverse[i] = imageLinear(lens, polygon[i].z);
    }
    for (int i = 1; i + 1 < count; ++i) {
        Fixed t{{x[0], x[i], x[i + 1]}, {y[0], y[i], y[i + 1]}, {inverse[0], inverse[i], inverse[i + 1]}, of.id};
        takeTriangle(f, t, of, large, visibility);
    }
}

/// Camera-space positions of a cluster's vertices.
[[gnu::always_inline]] inline void placeShort(const DrawMesh& m, const int* __restrict words, size_t count,
                                              float* __restrict x, float* __restrict y, float* __restrict z) {
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const vec3 c = meshPosition(words[8 * i], words[8 * i + 1], words[8 * i + 2], m);
        x[i] = c.x;
        y[i] = c.y;
        z[i] = c.z;
    }
}
void placeWide(const MeshBlock& block, float* x, float* y, float* z) {
    const uint32_t slots = block.counts & 0xffffu;
    for (uint32_t i = 0; i < slots; ++i) {  // (slots without a vertex, too: no triangle names them)
        const vec3 c = placeOf(block, i < slots / 2 || block.mesh->places != kPlacesPaired ? i : 0);
        x[i] = c.x;
        y[i] = c.y;
        z[i] = c.z;
    }
}

/// Corners of a block's triangles: places in camera space, and where they are seen in 1/256 px.
struct PlacedCorners {
    alignas(64) float x[256], y[256], z[256], inverse[256];
    alignas(64) int32_t px[256], py[256], clip[256];
};

[[gnu::always_inline]] inline void projectCorners(const FrameConstants& f, size_t count, PlacedCorners& __restrict p) {
    const Lens lens = lensHere(f.focal);
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const vec3 c = vec3(p.x[i], p.y[i], p.z[i]);
        const float scale = f.focal / lensDepth(lens, c.z);
        const float sx = c.x * scale + f.centre.x, sy = c.y * scale + f.centre.y;
        const bool isIn = (c.z >= f.nearPlane) & (abs(sx) < kGuardPixels) & (abs(sy) < kGuardPixels);
        p.inverse[i] = imageLinear(lens, c.z);
        p.px[i] = isIn ? int(floor(sx * kSubpixel + 0.5f)) : 0;
        p.py[i] = isIn ? int(floor(sy * kSubpixel + 0.5f)) : 0;
        p.clip[i] = isIn ? 0 : 1;
    }
}

/// Offers one triangle of those corners.
[[gnu::always_inline]] inline void offerTriangle(const FrameConstants& f, const PlacedCorners& p, uint32_t a,
                                                 uint32_t b, uint32_t c, const Candidate& of, const LargeSink& large,
                                                 const Visibility& visibility) {
    if ((p.clip[a] | p.clip[b] | p.clip[c]) != 0) {
        const vec3 corners[3] = {{p.x[a], p.y[a], p.z[a]}, {p.x[b], p.y[b], p.z[b]}, {p.x[c], p.y[c], p.z[c]}};
        clipTriangle(f, corners, of, large, visibility);
        return;
    }
    // Most triangles of a dense mesh contain no pixel's centre, or lie outside.
    const int right = static_cast<int>(f.width) * 256, bottom = static_cast<int>(f.height) * 256;
    const int x0 = p.px[a], x1 = p.px[b], x2 = p.px[c], y0 = p.py[a], y1 = p.py[b], y2 = p.py[c];
    const int minX = x0 < x1 ? (x0 < x2 ? x0 : x2) : (x1 < x2 ? x1 : x2);
    const int maxX = x0 > x1 ? (x0 > x2 ? x0 : x2) : (x1 > x2 ? x1 : x2);
    const int minY = y0 < y1 ? (y0 < y2 ? y0 : y2) : (y1 < y2 ? y1 : y2);
    const int maxY = y0 > y1 ? (y0 > y2 ? y0 : y2) : (y1 > y2 ? y1 : y2);
    if (((minX + 127) >> 8) > ((maxX - 128) >> 8) || ((minY + 127) >> 8) > ((maxY - 128) >> 8)) return;
    if (maxX < 0 || maxY < 0 || minX >= right || minY >= bottom) return;
    Fixed fixed{{x0, x1, x2}, {y0, y1, y2}, {p.inverse[a], p.inverse[b], p.inverse[c]}, of.id};
    takeTriangle(f, fixed, of, large, visibility);
}

void rasterCluster(const FrameConstants& frame, const SurfaceMaterial* materials, const MeshBlock& block,
                   uint32_t firstPlace, const LargeSink& large, const Visibility& visibility) {
    const MeshVertex* const vertices = block.vertices;
    const uint32_t* const triangles = block.triangles;
    const uint32_t vertexCount = block.counts & 0xffffu, triangleCount = block.counts >> 16;
    const FrameConstants f = frame;
    const DrawMesh m = *block.mesh;
    PlacedCorners p;
    if (m.places == kPlacesShort)
        placeShort(m, &vertices->x, vertexCount, p.x, p.y, p.z);
    else
        placeWide(block, p.x, p.y, p.z);
    projectCorners(f, vertexCount, p);
    for (uint32_t k = 0; k < triangleCount; ++k) {
        const uint32_t t = triangles[k];
        const uint32_t a = t & 255u, b = t >> 8 & 255u, c = t >> 16 & 255u;
        const uint32_t surface = vertices[a].surface;
        MaskInput mask;
        Candidate of{drawId(f.firstBlock.of[kKindTriangles], firstPlace + k), (surface & kSurfaceTwoSided) != 0,
                     nullptr};
        if ((surface & kSurfaceMasked) != 0) {
            mask = {block.textures,
                    &materials[m.firstMaterial + (surface & kSurfaceMaterialMask)],
                    {&vertices[a], &vertices[b], &vertices[c]},
                    {{p.x[a], p.y[a], p.z[a]}, {p.x[b], p.y[b], p.z[b]}, {p.x[c], p.y[c], p.z[c]}}};
            of.mask = &mask;
        }
        offerTriangle(f, p, a, b, c, of, large, visibility);
    }
}

void rasterLarge(const FrameConstants& frame, const LargeTriangle* large, size_t count, uint32_t firstRow,
                 uint32_t lastRow, const Visibility& visibility) {
    const FrameConstants f = frame;
    for (size_t i = 0; i < count; ++i) {
        Fixed t{};
        for (int k = 0; k < 3; ++k) {
            t.x[k] = large[i].x[k];
            t.y[k] = large[i].y[k];
            t.inverseDepth[k] = large[i].inverseDepth[k];
        }
        t.id = large[i].id;
        fillRows(f, t, static_cast<int>(firstRow), static_cast<int>(lastRow), visibility);
    }
}
