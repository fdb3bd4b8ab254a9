// From reconstructed rows to surfaces, and from surfaces to the picture. Included by kernels.inl, once per instruction
// set.

/// (x, y): the first pixel's centre, px from the principal point. `flat`: 0 where a pixel shows a tube.
[[gnu::always_inline]] inline void surfaceNormals(const TexelRow& __restrict row, const float* __restrict flat, float x,
                                                  float y, float focal, uint32_t n, SurfaceRow& __restrict out) {
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + i;
        // The disc's, as seen at its centre (a tube's: as seen at the pixel).
        const vec3 v = viewDirection(x + float(int(i)) + flat[i] * row.x[at], y + flat[i] * row.y[at], lensHere(focal));
        const vec3 normal = normalFromPerp(vec2(row.perpX[at], row.perpY[at]), v);
        out.nx[i] = normal.x;
        out.ny[i] = normal.y;
        out.nz[i] = normal.z;
    }
}

void surfaceRow(const FrameConstants& frame, const TexelRow& __restrict own, const TexelRow& __restrict row,
                const SurfacePlanes& planes, const SurfaceWants& wants, uint32_t x0, uint32_t y, uint32_t n,
                SurfaceRow& __restrict out) {
    const float focal = frame.focal, x = float(int(x0)) + 0.5f - frame.centre.x,
                py = float(int(y)) + 0.5f - frame.centre.y;
    // Of rows without tubes isRound is not set.
    alignas(64) float flat[kTile];
    for (size_t i = 0; i < n; ++i) flat[i] = row.hasTubes ? 1.0f - row.isRound[kPad + i] : 1.0f;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + i;
        out.depth[i] = row.depth[at];
        out.red[i] = row.red[at];
        out.green[i] = row.green[at];
        out.blue[i] = row.blue[at];
    }
    const uint32_t* const triangles = planes.surface;
    out.hasTriangles = triangles != nullptr;
    out.hasMaterials = row.hasMaterials;
    out.hasEmission = triangles != nullptr && planes.emissive != nullptr;
    out.hasCoverage = planes.coverage != nullptr;
    for (size_t i = 0; out.hasCoverage && i < n; ++i)
        out.coverage[i] = float(int(planes.coverage[i])) * (1.0f / 255.0f);
    if (row.hasMaterials)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const TexelSurface s{row.share[kPad + i], row.metallic[kPad + i], row.roughness[kPad + i]};
            out.material[i] = surfaceWord(s);
        }
    else
        for (size_t i = 0; i < n; ++i) out.material[i] = kPlainSurface;
    if (triangles != nullptr)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            // A triangle's pixel that no splat stands in front of.
            const uint32_t drawn = triangles[i];
            const uint32_t inFront = row.depth[kPad + i] == own.depth[kPad + i] ? drawn : 0u;
            out.material[i] = inFront != 0 ? inFront : out.material[i];
        }
    for (size_t i = 0; out.hasEmission && i < n; ++i)
        out.emission[i] = (out.material[i] & kPixelTriangle) != 0 ? planes.emissive[i] : 0u;
    if (wants.normal) surfaceNormals(row, flat, x, py, focal, n, out);
    const float isMerged = wants.isMerged ? 1.0f : 0.0f;
    if (wants.depth)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const size_t at = kPad + i;
            const float depth =
                planeDepth(row.depth[at], max(row.radius[at], 1.0e-3f), vec2(row.perpX[at], row.perpY[at]), row.x[at],
                           row.y[at], 1.0f - flat[i], isMerged, x + float(int(i)), py, lensHere(focal));
            out.depth[i] = kOrthographic && !(row.depth[at] > 0.0f) ? row.depth[at] : depth;  // nothing stays nothing
        }
    const float mayBeRibbon = row.hasTubes ? 1.0f : 0.0f;
    if (wants.leaf)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const size_t at = kPad + i;
            out.leaf[i] =
                letsLightThrough(row.thickness[at], row.radius[at], row.isRound[at], mayBeRibbon * row.axisX[at]);
        }
    if (wants.ownDepth)
        for (size_t i = 0; i < n; ++i)
            out.ownDepth[i] = row.depth[kPad + i] == own.depth[kPad + i] ? out.depth[i] : own.depth[kPad + i];
}

void smoothRow(const FrameConstants& frame, const TexelRow& __restrict texels, const SurfaceRow& __restrict mean,
               const SurfacePlanes& planes, uint32_t n, SurfaceRow& __restrict out) {
    const Lens lens = lensHere(frame.focal);
    const uint8_t* __restrict const isWide = planes.smooth;
    alignas(64) uint32_t taken[kTile];
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        Texel t;
        t.depth = texels.depth[kPad + i];
        t.thickness = texels.thickness[kPad + i];
        const float isOne = isOfSurface(t, mean.depth[i], out.depth[i], lens);
        taken[i] = isOne * float(int(isWide[i])) > 0.5f ? 1u : 0u;
    }
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const bool is = taken[i] != 0u;
        out.red[i] = is ? mean.red[i] : out.red[i];
        out.green[i] = is ? mean.green[i] : out.green[i];
        out.blue[i] = is ? mean.blue[i] : out.blue[i];
        out.nx[i] = is ? mean.nx[i] : out.nx[i];
        out.ny[i] = is ? mean.ny[i] : out.ny[i];
        out.nz[i] = is ? mean.nz[i] : out.nz[i];
        out.leaf[i] = is ? mean.leaf[i] : out.leaf[i];
        out.material[i] = is ? mean.material[i] : out.material[i];
    }
}

void keepRow(const SurfaceRow& __restrict row, const SurfaceWants& wants, uint32_t n, const KeptRow& out) {
    float* __restrict const depth = out.depth;
    uint32_t* __restrict const colour = out.colour;
    uint32_t* __restrict const material = out.material;
    uint32_t* __restrict const normal = out.normal;
    const bool isNew = depth != nullptr;
    for (size_t i = 0; isNew && i < n; ++i) depth[i] = row.depth[i];
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) colour[i] = packColour(row.red[i], row.green[i], row.blue[i]);
    if (wants.leaf)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) material[i] = row.material[i] | (row.leaf[i] > 0.5f ? kPixelLeaf : 0u);
    else
        for (size_t i = 0; i < n; ++i) material[i] = row.material[i];
    if (wants.normal && isNew)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            // Of a pixel without a surface any.
            const bool isThere = row.depth[i] > 0.0f;
            normal[i] =
                octEncode(vec3(isThere ? row.nx[i] : 0.0f, isThere ? row.ny[i] : 0.0f, isThere ? row.nz[i] : -1.0f));
        }
}

bool takeRow(const KeptRow& from, const SurfaceWants& wants, uint32_t n, SurfaceRow& __restrict row) {
    const float* __restrict const depth = from.depth;
    const uint32_t* __restrict const colour = from.colour;
    const uint32_t* __restrict const material = from.material;
    const uint32_t* __restrict const normal = from.normal;
    bool any = false;
    for (size_t i = 0; i < n; ++i) any |= depth[i] > 0.0f;
    if (!any) return false;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        row.depth[i] = row.ownDepth[i] = depth[i];
        row.red[i] = unpackRed(colour[i]);
        row.green[i] = unpackGreen(colour[i]);
        row.blue[i] = unpackBlue(colour[i]);
        row.material[i] = material[i];
        row.leaf[i] = (material[i] & kPixelLeaf) != 0u ? 1.0f : 0.0f;
    }
    if (wants.normal)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const vec3 unit = octDecode(normal[i]);
            row.nx[i] = unit.x;
            row.ny[i] = unit.y;
            row.nz[i] = unit.z;
        }
    return true;
}

/// The debug views that are seen in the place of colours.
void debugColours(const FrameConstants& f, uint32_t n, const SurfaceRow& __restrict row, float* __restrict red,
                  float* __restrict green, float* __restrict blue) {
    const bool showsHoles = f.debugView == kDebugHoles;
    for (size_t i = 0; i < n; ++i) {
        const vec3 c = showsHoles ? debugHoleColour(row.ownDepth[i], row.depth[i])
                                  : vec3(0.5f + 0.5f * row.nx[i], 0.5f - 0.5f * row.ny[i], 0.5f - 0.5f * row.nz[i]);
        red[i] = c.x;
        green[i] = c.y;
        blue[i] = c.z;
    }
}

/// Colours over what is behind them; `share`: of the pixel, null: all of it where anything is.
void overBehind(const SurfaceRow& __restrict row, const float* __restrict share, uint32_t n, float* __restrict red,
                float* __restrict green, float* __restrict blue) {
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float own = row.depth[i] > 0.0f ? (share != nullptr ? share[i] : 1.0f) : 0.0f;
        red[i] = own > 0.0f ? row.behindRed[i] + own * (red[i] - row.behindRed[i]) : row.behindRed[i];
        green[i] = own > 0.0f ? row.behindGreen[i] + own * (green[i] - row.behindGreen[i]) : row.behindGreen[i];
        blue[i] = own > 0.0f ? row.behindBlue[i] + own * (blue[i] - row.behindBlue[i]) : row.behindBlue[i];
    }
}

void outputRow(const FrameConstants& frame, const Tables& tables, uint32_t n, const SurfaceRow& __restrict row,
               const ShadeOutput& out) {
    const FrameConstants f = frame;
    alignas(64) float red[kTile], green[kTile], blue[kTile];
    alignas(64) uint32_t ir[kTile], ig[kTile], ib[kTile];
    if (f.debugView == kDebugHoles || f.debugView == kDebugNormals)
        debugColours(f, n, row, red, green, blue);
    else
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            red[i] = row.red[i];
            green[i] = row.green[i];
            blue[i] = row.blue[i];
        }
    const bool hasShare = row.hasCoverage || row.hasOpacity;
    alignas(64) float share[kTile];
    if (hasShare)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i)
            share[i] =
                (row.hasCoverage ? row.coverage[i] : 1.0f) * (row.hasOpacity ? wordOpacity(row.material[i]) : 1.0f);
    if (row.hasBehind) {
        overBehind(row, hasShare ? share : nullptr, n, red, green, blue);
    } else if (hasShare) {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            red[i] = f.background.x + share[i] * (red[i] - f.background.x);
            green[i] = f.background.y + share[i] * (green[i] - f.background.y);
            blue[i] = f.background.z + share[i] * (blue[i] - f.background.z);
        }
    }
    const bool isWhole = row.hasBehind;
    // max(0, v) of what is no number is 0: these index a table.
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const bool valid = isWhole | (row.depth[i] > 0.0f);
        red[i] = valid ? red[i] : f.background.x;
        green[i] = valid ? green[i] : f.background.y;
        blue[i] = valid ? blue[i] : f.background.z;
        ir[i] = uint(int(std::sqrt(min(max(0.0f, red[i]), 1.0f)) * 2047.0f + 0.5f));
        ig[i] = uint(int(std::sqrt(min(max(0.0f, green[i]), 1.0f)) * 2047.0f + 0.5f));
        ib[i] = uint(int(std::sqrt(min(max(0.0f, blue[i]), 1.0f)) * 2047.0f + 0.5f));
    }
    const uint32_t* __restrict const byteOf = tables.srgbByte.data();
    uint32_t* __restrict const rgba = out.rgba;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const uint32_t alpha = row.depth[i] > 0.0f ? 0xff000000u : 0u;
        rgba[i] = byteOf[ir[i]] | byteOf[ig[i]] << 8 | byteOf[ib[i]] << 16 | alpha;
    }
    if (hasShare)
        for (size_t i = 0; i < n; ++i) {
            const auto alpha = uint32_t(row.depth[i] > 0.0f ? share[i] * 255.0f + 0.5f : 0.0f);
            rgba[i] = (rgba[i] & 0xffffffu) | alpha << 24;
        }
    // What rays meet: of a pixel that is hardly covered nothing. (What it shows through does not matter.)
    alignas(64) float met[kTile];
    for (size_t i = 0; i < n; ++i) met[i] = row.depth[i];
    if (row.hasCoverage)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) met[i] = row.coverage[i] < kLeastShown ? 0.0f : row.depth[i];
    if (out.normal != nullptr)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const bool valid = met[i] > 0.0f;
            const float x = row.nx[i], y = row.ny[i], z = row.nz[i];
            out.normal[3 * i] = valid ? f.viewX.x * x + f.viewY.x * y + f.viewZ.x * z : 0.0f;
            out.normal[3 * i + 1] = valid ? f.viewX.y * x + f.viewY.y * y + f.viewZ.y * z : 0.0f;
            out.normal[3 * i + 2] = valid ? f.viewX.z * x + f.viewY.z * y + f.viewZ.z * z : 0.0f;
        }
    if (out.depth != nullptr)
        for (size_t i = 0; i < n; ++i) out.depth[i] = met[i];
    if (out.linear != nullptr)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            out.linear[3 * i] = red[i];
            out.linear[3 * i + 1] = green[i];
            out.linear[3 * i + 2] = blue[i];
        }
}
