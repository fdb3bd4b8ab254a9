// Effects on rows of surfaces: eye-dome lighting, fog, tone, the background (shaders/shared). Included by kernels.inl,
// once per instruction set.

void edlLogs(const EdlConstants& constants, const float* __restrict depth, uint32_t n, float* __restrict out) {
    const float perDepth = kOrthographic ? constants.perDepth : 0.0f;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) out[i] = edlDepth(depth[i], perDepth);
}

/// Adds how much nearer the neighbours at `away` px of a scale are, times `weight`. `here`, `rows`: logarithms of depth
/// from the row's first pixel on; rows: of the rows above and below, the straight ones first.
[[gnu::always_inline]] inline void addNearer(const float* __restrict here, const EdlRows& rows, int straight,
                                             int slanted, float weight, uint32_t n, float* __restrict sum) {
    const float *const above = rows.straightAbove, *const below = rows.straightBelow;
    const float *const left = here - straight, *const right = here + straight;
    const float *const aboveLeft = rows.slantedAbove - slanted, *const aboveRight = rows.slantedAbove + slanted;
    const float *const belowLeft = rows.slantedBelow - slanted, *const belowRight = rows.slantedBelow + slanted;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float d = here[i];
        const float across =
            max(d - left[i], 0.0f) + max(d - right[i], 0.0f) + max(d - above[i], 0.0f) + max(d - below[i], 0.0f);
        const float slant = max(d - aboveLeft[i], 0.0f) + max(d - aboveRight[i], 0.0f) + max(d - belowLeft[i], 0.0f) +
                            max(d - belowRight[i], 0.0f);
        sum[i] += weight * (across + slant);
    }
}

void edlRow(const FrameConstants& frame, const EdlConstants& constants, const float* here, const EdlRows* scales,
            uint32_t n, SurfaceRow& __restrict row) {
    const EdlConstants c = constants;
    const uint32_t shade = frame.shade;
    alignas(64) float sum[kTile];
    for (size_t i = 0; i < n; ++i) sum[i] = 0.0f;
    addNearer(here, scales[0], c.straight0, c.slanted0, c.weight0, n, sum);
    if (c.scales > 1) addNearer(here, scales[1], c.straight1, c.slanted1, c.weight1, n, sum);
    if (c.scales > 2) addNearer(here, scales[2], c.straight2, c.slanted2, c.weight2, n, sum);
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float left = 1.0f - fade(c.strength * sum[i]);
        const bool isSeen = row.depth[i] > 0.0f;
        const float share = isSeen & edlConcerns(row.material[i], shade, c.lit) ? left : 1.0f;
        row.red[i] *= share;
        row.green[i] *= share;
        row.blue[i] *= share;
    }
}

void fogRow(const FrameConstants& frame, const FogConstants& constants, uint32_t x0, uint32_t y, uint32_t n,
            SurfaceRow& __restrict row) {
    const FogConstants f = constants;
    const Lens lens = lensHere(frame.focal);
    const float inverseFocal = 1.0f / frame.focal, x = float(int(x0)) + 0.5f - frame.centre.x,
                vy = (float(int(y)) + 0.5f - frame.centre.y) * inverseFocal;
    alignas(64) float path[kTile];
    if (f.inverseHeight > 0.0f)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i)
            path[i] = fogPath(f, pixelRay(lens, (x + float(int(i))) * inverseFocal, vy), row.depth[i]);
    else
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i)
            path[i] = fogWay(f, pixelRay(lens, (x + float(int(i))) * inverseFocal, vy), row.depth[i]);
    if (f.isGrey != 0)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const float lost = fade(f.density.x * path[i]);
            row.red[i] += lost * (f.colour.x - row.red[i]);
            row.green[i] += lost * (f.colour.y - row.green[i]);
            row.blue[i] += lost * (f.colour.z - row.blue[i]);
        }
    else
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            row.red[i] += fade(f.density.x * path[i]) * (f.colour.x - row.red[i]);
            row.green[i] += fade(f.density.y * path[i]) * (f.colour.y - row.green[i]);
            row.blue[i] += fade(f.density.z * path[i]) * (f.colour.z - row.blue[i]);
        }
}

void toneRow(const ToneConstants& tone, uint32_t n, SurfaceRow& __restrict row) {
    const float exposure = tone.exposure;
    if (tone.isFilmic == 0) {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            row.red[i] *= exposure;
            row.green[i] *= exposure;
            row.blue[i] *= exposure;
        }
        return;
    }
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        row.red[i] = filmic(exposure * row.red[i]);
        row.green[i] = filmic(exposure * row.green[i]);
        row.blue[i] = filmic(exposure * row.blue[i]);
    }
}

void backgroundRow(const FrameConstants& frame, const BackgroundConstants& constants, const uint32_t* __restrict texels,
                   uint32_t x0, uint32_t y, uint32_t n, SurfaceRow& __restrict row) {
    const BackgroundConstants b = constants;
    const Lens lens = lensHere(frame.focal);
    const float inverseFocal = 1.0f / frame.focal, x = float(int(x0)) + 0.5f - frame.centre.x,
                vy = (float(int(y)) + 0.5f - frame.centre.y) * inverseFocal;
    alignas(64) float across[kTile], down[kTile], level[kTile];
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const vec3 ray = rayDirection(pixelRay(lens, (x + float(int(i))) * inverseFocal, vy));
        const vec2 place = backdropPlace(backdropDirection(b, ray));
        across[i] = place.x;
        down[i] = place.y;
        level[i] = backdropLevel(b, dot(ray, ray));
    }
    // Of a row about which the finest level is seen, all are of it.
    float most = 0.0f;
    for (size_t i = 0; i < n; ++i) most = max(most, level[i]);
    const auto look = [&](uint32_t l, size_t i) __attribute__((always_inline)) {
        const BackdropTaps t =
            backdropTaps(b.first[l], backdropSize(b.width, l), backdropSize(b.height, l), vec2(across[i], down[i]));
        return mixTaps(t, backdropLight(texels[t.at00]), backdropLight(texels[t.at10]), backdropLight(texels[t.at01]),
                       backdropLight(texels[t.at11]));
    };
    const auto show = [&](size_t i, const vec3& fine, const vec3& coarse,
                          float between) __attribute__((always_inline)) {
        const vec3 c = backdropShown(b, fine, coarse, between);
        row.behindRed[i] = c.x;
        row.behindGreen[i] = c.y;
        row.behindBlue[i] = c.z;
    };
    // (Look-ups anywhere in a picture: no SIMD is made of these loops.)
    if (!(most > 0.0f))
        for (size_t i = 0; i < n; ++i) {
            const vec3 c = look(0u, i);
            show(i, c, c, 0.0f);
        }
    else
        for (size_t i = 0; i < n; ++i) {
            const auto fine = uint32_t(int(level[i]));
            const uint32_t coarse = fine + 1u < b.levels ? fine + 1u : fine;
            show(i, look(fine, i), look(coarse, i), level[i] - float(int(fine)));
        }
}
