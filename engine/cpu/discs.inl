// Wide discs of the cpu backend (shaders/shared/wide_disc.h): their pixels into the visibility buffer, and texels of
// those that won. Included by kernels.inl, once per instruction set.

void fillDiscs(const FrameConstants& frame, const WideDisc* discs, const DiscBox* boxes, size_t count,
               uint32_t firstRow, uint32_t lastRow, const Visibility& visibility) {
    const FrameConstants f = frame;
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    const Lens lens = lensHere(f.focal);
    alignas(64) float depth[kTile];
    for (size_t k = 0; k < count; ++k) {
        const WideDisc d = discs[k];
        const uint64_t id = drawId(f.firstBlock.of[kKindDiscs], d.id);
        const DiscBox& box = boxes[k];
        const int y0 = box.y.first < int(firstRow) ? int(firstRow) : box.y.first;
        const int y1 = box.y.last > int(lastRow) ? int(lastRow) : box.y.last;
        for (int y = y0; y <= y1; ++y)
            for (int from = box.x.first; from <= box.x.last; from += int(kTile)) {
                const int n = box.x.last + 1 - from < int(kTile) ? box.x.last + 1 - from : int(kTile);
                const float ey = (float(y) + 0.5f - f.centre.y) * inverseFocal;
                const float shift = float(from) + 0.5f - f.centre.x;
#pragma GCC ivdep
                for (int i = 0; i < n; ++i)
                    depth[i] = discHit(d, pixelRay(lens, (float(i) + shift) * inverseFocal, ey), nearPlane).depth;
                const size_t first = size_t(y) * f.width + size_t(from);
                for (int i = 0; i < n; ++i)
                    if (depth[i] < kNoDisc)
                        offerKey(visibility, first + size_t(i), visibilityKey(floatBitsToUint(depth[i]), id));
            }
    }
}

/// A point's colour, linear.
vec3 pointColour(const FrameConstants& f, const Tables& tables, const DrawNode& node, const PointRecord& r) {
    if (f.debugView == kDebugLevel) return debugLevelColour(node.level);
    if (f.debugView == kDebugError) return debugErrorColour(node.errorPixels);
    const uint32_t c =
        tables.red[r.colour & 255u] | tables.green[r.colour >> 8 & 255u] | tables.blue[r.colour >> 16 & 255u];
    return vec3(unpackRed(c), unpackGreen(c), unpackBlue(c));
}

/// Sums over the discs at the pixels of a row.
struct DiscSums {
    alignas(64) float ex[kTile], front[kTile], apart[kTile], thickness[kTile];
    alignas(64) float weight[kTile],
        inverseDepth[kTile], nx[kTile], ny[kTile], nz[kTile], red[kTile], green[kTile], blue[kTile];
    alignas(64) float share[kTile], metallic[kTile], roughness[kTile];
};

void addDisc(const WideDisc& disc, const vec3& colour, const TexelSurface& surface, float ey, float nearPlane, size_t n,
             DiscSums& __restrict s) {
    const WideDisc d = disc;
    const float r = colour.x, g = colour.y, b = colour.z;
    const float share = surface.share, metallic = surface.metallic, roughness = surface.roughness;
    // Towards the eye, all over the picture: the eye lies on one side of the plane.
    const Lens lens = lensHere(1.0f);
    const float flip = dot(d.normal, sightTo(lens, d.centre)) > 0.0f ? -1.0f : 1.0f;
    const float nx = flip * d.normal.x, ny = flip * d.normal.y, nz = flip * d.normal.z;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const DiscHit hit = discHit(d, pixelRay(lens, s.ex[i], ey), nearPlane);
        const float w = discWeight(hit, s.front[i], s.apart[i]);
        s.weight[i] += w;
        s.inverseDepth[i] += kOrthographic ? w * hit.depth : w / hit.depth;
        s.nx[i] += w * nx;
        s.ny[i] += w * ny;
        s.nz[i] += w * nz;
        s.red[i] += w * r;
        s.green[i] += w * g;
        s.blue[i] += w * b;
        s.share[i] += w * share;
        s.metallic[i] += w * metallic;
        s.roughness[i] += w * roughness;
    }
}

/// Texels of the pixels that show wide discs: no ellipses, but what the pixel shows.
void resolveDiscs(const FrameConstants& f, const Tables& tables, const ResolveInput& in, const WinningPixels& p,
                  uint32_t x0, uint32_t y, TexelRow& __restrict row) {
    DiscSums s;
    const auto recordOf = [&](uint32_t id) { return in.blocks[id / kRecordsPerBlock].records[id % kRecordsPerBlock]; };
    const auto nodeOf = [&](uint32_t id) -> const DrawNode& { return *in.blocks[id / kRecordsPerBlock].node; };
    const float inverseFocal = 1.0f / f.focal, ey = (float(y) + 0.5f - f.centre.y) * inverseFocal;
    const Lens lens = lensHere(f.focal);
    uint32_t last = ~0u;
    WideDisc front{};
    bool isLeafHere = false;
    for (size_t i = 0; i < p.count; ++i) {
        if (p.id[i] != last) {
            last = p.id[i];
            const PointRecord r = recordOf(last);
            front = wideDisc(nodeOf(last), r, f.supportScale, last, lens);
            isLeafHere = (recordFlags(r) & kFlagLeaf) != 0u;
        }
        s.ex[i] = (float(x0 + p.pixel[i]) + 0.5f - f.centre.x) * inverseFocal;
        s.front[i] = p.depth[i];
        s.apart[i] = depthShared(front, pixelRay(lens, s.ex[i], ey));
        // Its mean is of what lies so far apart.
        s.thickness[i] = isLeafHere ? kLeafThickness * kExactRadius
                                    : s.apart[i] * f.focal / lensDepth(lens, max(s.front[i], kLeastDepth));
        s.weight[i] = s.inverseDepth[i] = s.nx[i] = s.ny[i] = s.nz[i] = s.red[i] = s.green[i] = s.blue[i] = 0.0f;
        s.share[i] = s.metallic[i] = s.roughness[i] = 0.0f;
    }
    for (size_t k = 0; k < in.discCount; ++k) {
        const uint32_t id = in.discs[k].id;
        const DiscBox& box = in.discBoxes[k];
        if (int(y) < box.y.first || int(y) > box.y.last || int(x0) > box.x.last || int(x0 + kTile) <= box.x.first)
            continue;
        const TexelSurface surface = surfaceOfPoint(in.blocks[id / kRecordsPerBlock].materialOf(id % kRecordsPerBlock));
        addDisc(in.discs[k], pointColour(f, tables, nodeOf(id), recordOf(id)), surface, ey, f.nearPlane, p.count, s);
    }
    for (size_t i = 0; i < p.count; ++i) {
        const size_t at = kPad + p.pixel[i];
        const float inverse = 1.0f / s.weight[i];
        const vec3 sum = vec3(s.nx[i], s.ny[i], s.nz[i]);
        const float shorten = 1.0f / std::sqrt(max(dot(sum, sum), 1.0e-20f));
        const vec3 n = vec3(sum.x * shorten, sum.y * shorten, sum.z * shorten);
        const vec2 perp = perpFromNormal(n, viewDirection(s.ex[i] * f.focal, ey * f.focal, lens));
        row.depth[at] = kOrthographic ? s.inverseDepth[i] * inverse : s.weight[i] / s.inverseDepth[i];
        row.radius[at] = kExactRadius;
        row.thickness[at] = s.thickness[i];
        row.x[at] = row.y[at] = 0.0f;
        row.perpX[at] = perp.x;
        row.perpY[at] = perp.y;
        row.red[at] = s.red[i] * inverse;
        row.green[at] = s.green[i] * inverse;
        row.blue[at] = s.blue[i] * inverse;
        if (!row.hasMaterials) continue;
        row.share[at] = s.share[i] * inverse;
        row.metallic[at] = s.metallic[i] * inverse;
        row.roughness[at] = s.roughness[i] * inverse;
    }
}
