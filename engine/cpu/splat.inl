// Discs drawn exactly (shaders/shared/splat_disc.h). Included by kernels.inl, once per instruction set.

/// Normals of what wind bends are not as long as they were.
inline void makeUnit(size_t count, float* __restrict x, float* __restrict y, float* __restrict z) {
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const float shorten = 1.0f / std::sqrt(max(x[i] * x[i] + y[i] * y[i] + z[i] * z[i], 1.0e-37f));
        x[i] *= shorten;
        y[i] *= shorten;
        z[i] *= shorten;
    }
}

void placeSplats(const FrameConstants& frame, const DrawNode& drawNode, const PointRecord* records, uint32_t count,
                 const SplatReach& reach, SplatBlock& out) {
    const FrameConstants f = frame;
    const DrawNode node = drawNode;
    const float focal = f.focal, nearPlane = f.nearPlane, midX = f.centre.x, midY = f.centre.y;
    const float lastX = float(f.width) - 1.0f, lastY = float(f.height) - 1.0f;
    const float bx = node.base.x, by = node.base.y, bz = node.base.z, ax = node.axisX.x, ay = node.axisX.y,
                az = node.axisX.z, bbx = node.axisY.x, bby = node.axisY.y, bbz = node.axisY.z, ccx = node.axisZ.x,
                ccy = node.axisZ.y, ccz = node.axisZ.z;
    const NormalAxes m = normalAxes(node);
    const float least = node.spacing * reach.leastSpacings, radii = reach.radii, margin = reach.margin;
    const float edge = node.edge * f.supportScale, scattered = largestSplat(kFlagScattered, focal, f.height);
    const uint32_t errorCode = node.errorCode, octantMask = node.octantMask;
    const Lens lens = lensHere(focal);
    const uint* __restrict const words = &records->positionXY;  // four words a record
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const PointRecord r{words[4 * i], words[4 * i + 1], words[4 * i + 2], words[4 * i + 3]};
        const float qx = float(int(recordX(r))), qy = float(int(recordY(r))), qz = float(int(recordZ(r)));
        const float cx = bx + ax * qx + bbx * qy + ccx * qz;
        const float cy = by + ay * qx + bby * qy + ccy * qz;
        const float cz = bz + az * qx + bbz * qy + ccz * qz;
        const vec3 d = octDecode(r.normal);
        const vec3 sight = sightTo(lens, vec3(cx, cy, cz));
        const float away = -1.0f / std::sqrt(max(dot(sight, sight), 1.0e-37f));
        const bool isFree = (recordFlags(r) & kFlagNoNormal) != 0u;
        const float nx = isFree ? sight.x * away : (m.x.x * d.x + m.y.x * d.y + m.z.x * d.z) * m.scale;
        const float ny = isFree ? sight.y * away : (m.x.y * d.x + m.y.y * d.y + m.z.y * d.z) * m.scale;
        const float nz = isFree ? sight.z * away : (m.x.z * d.x + m.y.z * d.y + m.z.z * d.z) * m.scale;
        const float cap =
            (recordFlags(r) & kFlagScattered) != 0u ? max(lensDepth(lens, cz), 0.0f) * scattered : 3.0e38f;
        const float stored = edge * radiusFractionFast(recordRadiusCode(r));
        const float radius = min(max(stored, min(least, kOpaqueRadii * stored)), cap);
        out.cx[i] = cx;
        out.cy[i] = cy;
        out.cz[i] = cz;
        out.nx[i] = nx;
        out.ny[i] = ny;
        out.nz[i] = nz;
        out.radius[i] = radius;
        out.colour[i] = r.colour;
        const float drawnHere = float(int(octantMask >> recordOctant(r) & 1u));  // a bool would keep GCC from SIMD
        const bool fine = (recordErrorCode(r) <= errorCode) | (drawnHere > 0.5f);
        const bool seen = ((recordFlags(r) & (kFlagTwoSided | kFlagNoNormal)) != 0u) |
                          (nx * sight.x + ny * sight.y + nz * sight.z < 0.0f);
        const bool faces = !isFree | (cz > nearPlane);
        // The box of the disc's sphere, where that lies wholly before the eye; else whatever box it has (isNear).
        const float around = radius * radii;
        const float front = cz - around, back = cz + around;
        const bool isNear = !kOrthographic & !(front > 0.05f * cz);
        const float toFront = focal / lensDepth(lens, front), toBack = focal / lensDepth(lens, back);
        const float left = cx - around, right = cx + around, top = cy - around, bottom = cy + around;
        const float x0 = left * (left < 0.0f ? toFront : toBack) + (midX - margin),
                    x1 = right * (right > 0.0f ? toFront : toBack) + (midX + margin);
        const float y0 = top * (top < 0.0f ? toFront : toBack) + (midY - margin),
                    y1 = bottom * (bottom > 0.0f ? toFront : toBack) + (midY + margin);
        const bool isInside = isNear | ((x1 >= 0.0f) & (x0 < lastX + 1.0f) & (y1 >= 0.0f) & (y0 < lastY + 1.0f));
        const bool keep = fine & seen & faces & (back > nearPlane) & isInside;
        out.firstX[i] = int(min(max(x0, 0.0f), lastX));
        out.lastX[i] = int(min(max(x1, 0.0f), lastX));
        out.firstY[i] = int(min(max(y0, 0.0f), lastY));
        out.lastY[i] = int(min(max(y1, 0.0f), lastY));
        out.keep[i] = keep ? (isNear ? 2u : 1u) : 0u;
    }
    if ((node.octantMask & kNodeBent) != 0u) makeUnit(count, out.nx, out.ny, out.nz);
    // Those about the eye, one by one.
    for (size_t i = 0; i < count; ++i) {
        if (out.keep[i] != 2u) continue;
        const WideDisc d{
            {out.cx[i], out.cy[i], out.cz[i]}, {out.nx[i], out.ny[i], out.nz[i]}, out.radius[i] * radii, 0u};
        const CentrePixel c = centrePixel(d, f);
        const DiscBox box = discBox(d, f);
        const bool isEmpty = box.x.last < box.x.first || box.y.last < box.y.first || reachesPicture(d, f) < 0.5f;
        out.keep[i] = !isEmpty || c.x >= 0 ? 1u : 0u;
        out.firstX[i] = isEmpty ? c.x : box.x.first;
        out.lastX[i] = isEmpty ? c.x : box.x.last;
        out.firstY[i] = isEmpty ? c.y : box.y.first;
        out.lastY[i] = isEmpty ? c.y : box.y.last;
    }
}

/// Where a pixel's ray meets the plane of a disc, and how far from the centre, squared. (ex, ey): the pixel, px from
/// the principal point, over the focal length. `ahead`: normal . centre; `rest`: normal.y ey + normal.z.
struct SplatHit {
    float depth, off2;
};
[[gnu::always_inline]] inline SplatHit splatHit(vec3 centre, vec3 normal, float ahead, float rest, float ex, float ey) {
    if (kOrthographic) {
        const float x = centre.x - ex, y = centre.y - ey;
        const float z = (normal.x * x + normal.y * y) / normal.z;
        return {centre.z + z, x * x + y * y + z * z};
    }
    const float z = ahead / (normal.x * ex + rest);
    const float offX = z * ex - centre.x, offY = z * ey - centre.y, offZ = z - centre.z;
    return {z, offX * offX + offY * offY + offZ * offZ};
}

/// Some discs of a tile, ready to be drawn. `ahead`: distance of the eye from the plane, times the normal's sign.
struct SplatBatch {
    static constexpr size_t kSize = 64;
    alignas(64) float cx[kSize], cy[kSize], cz[kSize], nx[kSize], ny[kSize], nz[kSize], ahead[kSize], radius2[kSize];
    alignas(64) int firstX[kSize], lastX[kSize], firstY[kSize], lastY[kSize];
    alignas(64) int missed[kSize];  // pixel of the tile that holds the centre, but whose ray misses; else -1
};

void prepareSplats(const FrameConstants& frame, const PlacedSplat* splats, const uint32_t* places, size_t count,
                   const SplatTile& tile, SplatBatch& __restrict b) {
    const FrameConstants f = frame;
    alignas(64) float radius[SplatBatch::kSize];
    for (size_t i = 0; i < count; ++i) {
        const PlacedSplat& s = splats[places[i]];
        b.cx[i] = s.cx;
        b.cy[i] = s.cy;
        b.cz[i] = s.cz;
        b.nx[i] = s.nx;
        b.ny[i] = s.ny;
        b.nz[i] = s.nz;
        radius[i] = s.radius;
    }
    const int x0 = int(tile.x0), y0 = int(tile.y0);
    const float focal = f.focal, inverseFocal = 1.0f / focal, nearPlane = f.nearPlane, far = 1.0e6f;
    const Lens lens = lensHere(focal);
    const int width = int(tile.width), height = int(tile.height);
    const float shiftX = float(x0) + 0.5f - f.centre.x, shiftY = float(y0) + 0.5f - f.centre.y;
#pragma GCC ivdep
    for (size_t i = 0; i < count; ++i) {
        const WideDisc d{vec3(b.cx[i], b.cy[i], b.cz[i]), vec3(b.nx[i], b.ny[i], b.nz[i]), radius[i], 0u};
        const CentrePixel c = centrePixel(d, f);
        // Pixels whose centres lie between the slopes that bound it; a hundredth is for rounding.
        const vec2 across = discSlopes(lens, d.centre.x, d.centre.z, d.normal.x, d.normal.z, d.radius);
        const vec2 down = discSlopes(lens, d.centre.y, d.centre.z, d.normal.y, d.normal.z, d.radius);
        b.ahead[i] = dot(d.normal, d.centre);
        b.radius2[i] = d.radius * d.radius;
        b.firstX[i] = -int(std::floor(min(max(shiftX - across.x * focal, -far), far) + 0.01f));
        b.lastX[i] = int(std::floor(min(max(across.y * focal - shiftX, -far), far) + 0.01f));
        b.firstY[i] = -int(std::floor(min(max(shiftY - down.x * focal, -far), far) + 0.01f));
        b.lastY[i] = int(std::floor(min(max(down.y * focal - shiftY, -far), far) + 0.01f));
        // Where the ray of the centre's pixel misses the disc, that pixel shows it at the centre's depth.
        const float ex = (float(c.x) + 0.5f - f.centre.x) * inverseFocal,
                    ey = (float(c.y) + 0.5f - f.centre.y) * inverseFocal;
        const SplatHit hit = splatHit(d.centre, d.normal, b.ahead[i], d.normal.y * ey + d.normal.z, ex, ey);
        const bool isHit = (hit.off2 <= b.radius2[i]) & (hit.depth > nearPlane);
        const int atX = c.x - x0, atY = c.y - y0;
        const bool isHere = (atX >= 0) & (atX < width) & (atY >= 0) & (atY < height);
        b.missed[i] = isHere & !isHit ? atY * int(SplatTile::kWidth) + atX : -1;
    }
}

/// The nearest of each pixel of a tile: bits of its depth, and which point, or kOther.
struct TileFront {
    static constexpr uint32_t kOther = ~0u;  ///< of another kind, or nothing: what is equally deep goes to points
    static constexpr size_t kPixels = size_t{SplatTile::kWidth} * SplatTile::kHeight;
    alignas(64) uint32_t depth[kPixels], id[kPixels];
};

/// Eight pixels of a row, of which a few may lie beside the disc.
constexpr int kSplatLanes = 8;
/// Where they begin for a disc, so that as few as possible of them reach all it may cover, and all are of the tile.
[[gnu::always_inline]] inline int firstLane(int firstX, int lastX) {
    const int first = firstX > 0 ? firstX : 0;
    const int last = int(SplatTile::kWidth) - (lastX - first + kSplatLanes) / kSplatLanes * kSplatLanes;
    return first < last ? first : last;
}

void drawSplat(const SplatBatch& b, size_t i, uint32_t id, const SplatTile& tile, const FrameConstants& f,
               TileFront& __restrict front) {
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const float cx = b.cx[i], cy = b.cy[i], cz = b.cz[i], nx = b.nx[i], ny = b.ny[i], nz = b.nz[i], ahead = b.ahead[i],
                radius2 = b.radius2[i];
    const float shift = float(int(tile.x0)) + 0.5f - f.centre.x, shiftY = float(int(tile.y0)) + 0.5f - f.centre.y;
    const int x1 = b.lastX[i] < int(tile.width) ? b.lastX[i] : int(tile.width) - 1;
    const int x0 = firstLane(b.firstX[i], x1);
    const int y0 = b.firstY[i] > 0 ? b.firstY[i] : 0;
    const int y1 = b.lastY[i] < int(tile.height) ? b.lastY[i] : int(tile.height) - 1;
    for (int y = y0; y <= y1; ++y) {
        const float ey = (float(y) + shiftY) * inverseFocal;
        const float rest = ny * ey + nz;
        for (int x = x0; x <= x1; x += kSplatLanes) {
            uint32_t* const depth = front.depth + y * int(SplatTile::kWidth) + x;
            uint32_t* const owner = front.id + y * int(SplatTile::kWidth) + x;
#pragma GCC ivdep
            for (int l = 0; l < kSplatLanes; ++l) {
                const float ex = (float(x + l) + shift) * inverseFocal;
                const SplatHit hit = splatHit(vec3(cx, cy, cz), vec3(nx, ny, nz), ahead, rest, ex, ey);
                const bool isHit = (hit.off2 <= radius2) & (hit.depth > nearPlane);
                const uint32_t bits = floatBitsToUint(hit.depth);
                const bool isFront = isHit & ((bits < depth[l]) | ((bits == depth[l]) & (id < owner[l])));
                depth[l] = isFront ? bits : depth[l];
                owner[l] = isFront ? id : owner[l];
            }
        }
    }
    if (b.missed[i] < 0) return;
    const auto at = size_t(b.missed[i]);
    const uint32_t bits = floatBitsToUint(cz);
    if (bits > front.depth[at] || (bits == front.depth[at] && id >= front.id[at])) return;
    front.depth[at] = bits;
    front.id[at] = id;
}

void splatTile(const FrameConstants& frame, const PlacedSplat* splats, const uint32_t* places, size_t count,
               const SplatTile& tile, const Visibility& visibility) {
    const FrameConstants f = frame;
    TileFront front;
    for (size_t i = 0; i < TileFront::kPixels; ++i) front.depth[i] = front.id[i] = ~0u;
    for (size_t y = 0; y < tile.height; ++y) {
        const uint64_t* const keys = visibility.keys + (tile.y0 + y) * f.width + tile.x0;
        for (size_t x = 0; x < tile.width; ++x) {
            front.depth[y * SplatTile::kWidth + x] = keyDepthBits(keys[x]);
            front.id[y * SplatTile::kWidth + x] =
                isPointKey(keys[x], f.firstBlock) ? keyPlace(keys[x], 0u) : TileFront::kOther;
        }
    }
    SplatBatch batch;
    for (size_t first = 0; first < count; first += SplatBatch::kSize) {
        const size_t n = count - first < SplatBatch::kSize ? count - first : SplatBatch::kSize;
        prepareSplats(f, splats, places + first, n, tile, batch);
        for (size_t i = 0; i < n; ++i) drawSplat(batch, i, splats[places[first + i]].id, tile, f, front);
    }
    for (size_t y = 0; y < tile.height; ++y) {
        const size_t first = (tile.y0 + y) * f.width + tile.x0;
        for (size_t x = 0; x < tile.width; ++x) {
            const uint32_t id = front.id[y * SplatTile::kWidth + x];
            if (id != TileFront::kOther)
                visibility.keys[first + x] = visibilityKey(front.depth[y * SplatTile::kWidth + x], drawId(0u, id));
        }
        for (size_t r = first >> Visibility::kRunBits; r <= (first + tile.width - 1) >> Visibility::kRunBits; ++r)
            __atomic_store_n(&visibility.runs[r], uint8_t{1}, __ATOMIC_RELAXED);
    }
}
