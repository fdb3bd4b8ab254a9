// Wide discs of the cpu backend (shaders/shared/wide_disc.h): their pixels into the visibility buffer, and texels of
// those that won. Included by kernels.inl, once per instruction set.

void fillDiscs(const FrameConstants& frame, const WideDisc* discs, size_t count, uint32_t firstRow, uint32_t lastRow,
               uint64_t* visibility) {
    const FrameConstants f = frame;
    const float inverseFocal = 1.0f / f.focal, nearPlane = f.nearPlane;
    alignas(64) float depth[kTile];
    for (size_t k = 0; k < count; ++k) {
        const WideDisc d = discs[k];
        const PixelRange x = pixelsBetween(discSlopes(d.centre.x, d.centre.z, d.normal.x, d.normal.z, d.radius),
                                           f.focal, f.centre.x, f.width);
        const PixelRange rows = pixelsBetween(discSlopes(d.centre.y, d.centre.z, d.normal.y, d.normal.z, d.radius),
                                              f.focal, f.centre.y, f.height);
        const int y0 = rows.first < int(firstRow) ? int(firstRow) : rows.first;
        const int y1 = rows.last > int(lastRow) ? int(lastRow) : rows.last;
        for (int y = y0; y <= y1; ++y)
            for (int from = x.first; from <= x.last; from += int(kTile)) {
                const int n = x.last + 1 - from < int(kTile) ? x.last + 1 - from : int(kTile);
                const float ey = (float(y) + 0.5f - f.centre.y) * inverseFocal;
                const float shift = float(from) + 0.5f - f.centre.x;
#pragma GCC ivdep
                for (int i = 0; i < n; ++i) depth[i] = discDepth(d, (float(i) + shift) * inverseFocal, ey, nearPlane);
                uint64_t* const row = visibility + size_t(y) * f.width + size_t(from);
                for (int i = 0; i < n; ++i)
                    if (depth[i] < kNoDisc) offerKey(row, size_t(i), uint64_t{floatBitsToUint(depth[i])} << 32 | d.id);
            }
    }
}

/// Texels of the pixels that show wide discs: no ellipses, but what the pixel shows.
void resolveDiscs(const FrameConstants& f, const Tables& tables, const ResolveInput& in, const WinningPixels& p,
                  uint32_t x0, uint32_t y, TexelRow& __restrict row) {
    for (size_t i = 0; i < p.count; ++i) {
        const BlockSource& block = in.blocks[p.id[i] / kRecordsPerBlock];
        const PointRecord r = block.records[p.id[i] % kRecordsPerBlock];
        const vec3 v = viewDirection(float(x0 + p.pixel[i]) + 0.5f - f.centre.x, float(y) + 0.5f - f.centre.y, f.focal);
        const vec3 n = discNormal(*block.node, r);
        const float flip = dot(n, v) > 0.0f ? -1.0f : 1.0f;
        const vec2 perp = perpFromNormal(n, v);
        const size_t at = kPad + p.pixel[i];
        row.depth[at] = p.depth[i];
        row.radius[at] = kExactRadius;
        row.thickness[at] = (recordFlags(r) & kFlagLoose) != 0u ? kLeafThickness * kExactRadius : kExactRadius;
        row.x[at] = row.y[at] = 0.0f;
        row.perpX[at] = perp.x * flip;
        row.perpY[at] = perp.y * flip;
        vec3 colour;
        if (f.debugView == kDebugLevel)
            colour = debugLevelColour(block.node->level);
        else if (f.debugView == kDebugError)
            colour = debugErrorColour(block.node->errorPixels);
        else {
            const uint32_t c =
                tables.red[r.colour & 255u] | tables.green[r.colour >> 8 & 255u] | tables.blue[r.colour >> 16 & 255u];
            colour = vec3(unpackRed(c), unpackGreen(c), unpackBlue(c));
        }
        row.red[at] = colour.x;
        row.green[at] = colour.y;
        row.blue[at] = colour.z;
    }
}
