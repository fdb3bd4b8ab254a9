// Light on the pixels of a row (SurfaceRow). Included by kernels.inl, once per instruction set.

/// The pixels of a row that are lit, closed up: of a forest's ground there may be few in each row.
struct alignas(64) LitPixels {
    uint32_t at[kTile];
    float x[kTile], y[kTile], depth[kTile], nx[kTile], ny[kTile], nz[kTile], leaf[kTile];
    float red[kTile], green[kTile], blue[kTile];
    uint32_t words[kTile];
};

/// Where the planes of n lit pixels are: the row's own where all of it is lit, else closed up. Places beside the
/// principal point, px.
struct LitPlanes {
    const float *x, *y, *depth, *nx, *ny, *nz, *leaf, *red, *green, *blue;
    const uint32_t* words;
    size_t n;
};

/// What the pixels send to the eye.
struct alignas(64) Sent {
    float r[kTile], g[kTile], b[kTile];
};

template <typename T>
[[gnu::always_inline]] inline const T* closeUp(const T* __restrict plane, const uint32_t* __restrict at, size_t n,
                                               T* __restrict closed) {
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) closed[i] = plane[at[i]];
    return closed;
}

/// Where `mask` says so; p.at: which they are. (offX, offY): the first pixel's centre, px from the principal point.
[[gnu::always_inline]] inline LitPlanes takeLit(const SurfaceRow& row, const uint32_t* __restrict mask, float offX,
                                                float offY, uint32_t pixels, LitPixels& p) {
    size_t n = 0;
    for (uint32_t i = 0; i < pixels; ++i) {
        p.at[n] = i;
        n += mask[i] != 0 ? 1 : 0;
    }
    float* __restrict const x = p.x;
    float* __restrict const y = p.y;
    const uint32_t* __restrict const at = p.at;
    const bool isHere = row.placeX == nullptr;
    if (isHere)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            x[i] = offX + float(int(at[i]));
            y[i] = offY;
        }
    const bool isAll = n == pixels;
    const auto plane = [&](const auto* from, auto* closed) { return isAll ? from : closeUp(from, at, n, closed); };
    return {isHere ? p.x : plane(row.placeX, p.x),
            isHere ? p.y : plane(row.placeY, p.y),
            plane(row.depth, p.depth),
            plane(row.nx, p.nx),
            plane(row.ny, p.ny),
            plane(row.nz, p.nz),
            plane(row.leaf, p.leaf),
            plane(row.red, p.red),
            plane(row.green, p.green),
            plane(row.blue, p.blue),
            plane(row.material, p.words),
            n};
}

/// The surfaces of the pixels; plain pointers, or loops over them do not become SIMD.
struct LitSurfaces {
    LitSurfaces(const LitPlanes& p, const Lens& of, float inverse)
        : px(p.x),
          py(p.y),
          nx(p.nx),
          ny(p.ny),
          nz(p.nz),
          leaf(p.leaf),
          pr(p.red),
          pg(p.green),
          pb(p.blue),
          word(p.words),
          lens(of),
          inverseFocal(inverse) {}
    [[gnu::always_inline]] Surface operator()(size_t i) const {
        const vec3 e = rayDirection(pixelRay(lens, px[i] * inverseFocal, py[i] * inverseFocal));
        const float inverse = 1.0f / std::sqrt(e.x * e.x + e.y * e.y + 1.0f);
        const vec3 ray = vec3(e.x * inverse, e.y * inverse, inverse);
        Surface s;
        s.colour = vec3(pr[i], pg[i], pb[i]);
        s.normal = vec3(nx[i], ny[i], nz[i]);
        s.toEye = vec3(-ray.x, -ray.y, -ray.z);
        s.metallic = float(int(word[i] & 255u)) * (1.0f / 255.0f);
        s.roughness = float(int(word[i] >> 8 & 255u)) * (1.0f / 255.0f);
        s.occlusion = wordOcclusion(word[i]);
        s.leaf = leaf[i];
        s.dielectric = vec3(kDielectric, kDielectric, kDielectric);
        return s;
    }
    const float *px, *py, *nx, *ny, *nz, *leaf, *pr, *pg, *pb;
    const uint32_t* word;
    Lens lens;
    float inverseFocal;
};

/// Of the sky or the environment, and of the sun where there are no other lights.
[[gnu::always_inline]] inline void addSurroundings(const FrameConstants& f, const LightInput& input,
                                                   const LitSurfaces surfaceAt, size_t n, float* __restrict r,
                                                   float* __restrict g, float* __restrict b) {
    const float ambient = f.ambient;
    const vec3 up = f.skyDirection;
    if (input.environment != nullptr) {
        for (size_t i = 0; i < n; ++i) {
            const vec3 c = reflectEnvironment(input.environment, surfaceAt(i), f.environmentX, f.environmentY,
                                              f.environmentZ, f.environmentSharp);
            r[i] = ambient * c.x;
            g[i] = ambient * c.y;
            b[i] = ambient * c.z;
        }
    } else {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const vec3 c = reflectSky(surfaceAt(i), up);
            r[i] = ambient * c.x;
            g[i] = ambient * c.y;
            b[i] = ambient * c.z;
        }
    }
    if (f.lightCount == 0 && input.environment == nullptr) {
        const vec3 sun = f.sunDirection;
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const vec3 c = reflectLight(surfaceAt(i), sun, vec3(0.75f, 0.75f, 0.75f));
            r[i] += c.x;
            g[i] += c.y;
            b[i] += c.z;
        }
    }
}

/// `mask`: of each, what of the light comes to it (packLight); only if isMasked.
template <bool isMasked>
[[gnu::always_inline]] inline void addLight(const LightSource& of, const float* __restrict depth,
                                            const uint32_t* __restrict mask, const LitSurfaces surfaceAt, size_t n,
                                            float* __restrict r, float* __restrict g, float* __restrict b) {
    const LightSource light = of;
    const float *const px = surfaceAt.px, *const py = surfaceAt.py;
    const Lens lens = surfaceAt.lens;
    const float inverseFocal = surfaceAt.inverseFocal;
    const bool isFar = light.kind == kLightDirectional;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const float z = depth[i];
        const vec3 point = alongRay(pixelRay(lens, px[i] * inverseFocal, py[i] * inverseFocal), z);
        vec3 l = vec3(light.position.x - (isFar ? 0.0f : point.x), light.position.y - (isFar ? 0.0f : point.y),
                      light.position.z - (isFar ? 0.0f : point.z));
        const float inverse = 1.0f / std::sqrt(max(l.x * l.x + l.y * l.y + l.z * l.z, 1.0e-12f));
        l = vec3(l.x * inverse, l.y * inverse, l.z * inverse);
        const float share = lightAt(light, point, z);
        vec3 sent = vec3(light.colour.x * share, light.colour.y * share, light.colour.z * share);
        if (isMasked) {
            const vec3 past = unpackLight(mask[i]);
            sent = vec3(sent.x * past.x, sent.y * past.y, sent.z * past.z);
        }
        const vec3 c = reflectLight(surfaceAt(i), l, sent);
        r[i] += c.x;
        g[i] += c.y;
        b[i] += c.z;
    }
}

/// Where `mask` says so. (offX, offY): the first pixel's centre, px from the principal point.
void lightSurfaces(const FrameConstants& f, const LightInput& input, const uint32_t* __restrict mask, float offX,
                   float offY, uint32_t pixels, SurfaceRow& __restrict row) {
    const float inverseFocal = 1.0f / f.focal;
    LitPixels p;
    Sent sent;
    const LitPlanes lit = takeLit(row, mask, offX, offY, pixels, p);
    const size_t n = lit.n;
    const LitSurfaces surfaceAt(lit, lensHere(f.focal), inverseFocal);
    addSurroundings(f, input, surfaceAt, n, sent.r, sent.g, sent.b);
    for (uint32_t k = 0; k < f.lightCount; ++k) {
        const LightSource& light = input.lights[k];
        const uint32_t shadow = input.shadowSlots != nullptr ? input.shadowSlots[k] : 0;
        if (shadow == 0 || shadow > row.shadowSlots || !row.isShadowed[shadow - 1]) {
            addLight<false>(light, lit.depth, nullptr, surfaceAt, n, sent.r, sent.g, sent.b);
            continue;
        }
        alignas(64) uint32_t closed[kTile];
        const uint32_t* const past =
            n == pixels ? row.shadow[shadow - 1] : closeUp(row.shadow[shadow - 1], p.at, n, closed);
        addLight<true>(light, lit.depth, past, surfaceAt, n, sent.r, sent.g, sent.b);
    }
    if (row.hasEmission)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const uint32_t emission = row.emission[p.at[i]];
            sent.r[i] += unpackRed(emission);
            sent.g[i] += unpackGreen(emission);
            sent.b[i] += unpackBlue(emission);
        }
    if (n == pixels) {
        for (size_t i = 0; i < n; ++i) {
            row.red[i] = sent.r[i];
            row.green[i] = sent.g[i];
            row.blue[i] = sent.b[i];
        }
        return;
    }
    for (size_t i = 0; i < n; ++i) {
        row.red[p.at[i]] = sent.r[i];
        row.green[p.at[i]] = sent.g[i];
        row.blue[p.at[i]] = sent.b[i];
    }
}

void lightRow(const FrameConstants& frame, const LightInput& light, uint32_t x0, uint32_t y, uint32_t n,
              SurfaceRow& __restrict row) {
    const FrameConstants f = frame;
    const bool litPoints = (f.shade & kShadeLit) != 0, litTriangles = (f.shade & kShadeTriangles) != 0;
    // Points with a material, or under lights of the scene's own, are surfaces like any other; else theirs is one
    // formula.
    const bool hasLights = f.lightCount > 0 || f.hasEnvironment != 0;
    alignas(64) float share[kTile];    // of that formula: 0 where a pixel keeps its colour
    alignas(64) uint32_t mask[kTile];  // pixels that are lit as surfaces
    const float pointShare = litPoints && !hasLights ? 1.0f : 0.0f;
    const uint32_t pointMask = litPoints && hasLights ? 1u : 0u, triangleMask = litTriangles ? 1u : 0u;
    for (size_t i = 0; i < n; ++i) {
        share[i] = pointShare;
        mask[i] = pointMask;
    }
    uint32_t anyMask = pointMask;
    const uint32_t materialMask = litPoints ? 1u : 0u;
    if (row.hasTriangles || row.hasMaterials)
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const bool isTriangle = (row.material[i] & kPixelTriangle) != 0;
            const bool hasMaterial = (row.material[i] & kPixelMaterial) != 0;
            const uint32_t isLit = (row.material[i] & kPixelUnlit) == 0 ? triangleMask : 0u;
            share[i] = isTriangle | hasMaterial ? 0.0f : share[i];
            mask[i] = isTriangle ? isLit : hasMaterial ? materialMask : pointMask;
            anyMask |= mask[i];
        }
    if (litPoints) {
        const vec3 sun = f.sunDirection, sky = f.skyDirection;
        alignas(64) float open[kTile];
        for (size_t i = 0; i < n; ++i) open[i] = 1.0f;
        if (row.hasOcclusion)
#pragma GCC ivdep
            for (size_t i = 0; i < n; ++i) open[i] = float(int(row.material[i] >> 16 & 255u)) * (1.0f / 255.0f);
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const float sunlight = irradiance(vec3(row.nx[i], row.ny[i], row.nz[i]), sun, sky, row.leaf[i], open[i]);
            const float brightness = 1.0f + share[i] * (sunlight - 1.0f);
            row.red[i] *= brightness;
            row.green[i] *= brightness;
            row.blue[i] *= brightness;
        }
    }
    if (anyMask != 0)
        lightSurfaces(f, light, mask, float(int(x0)) + 0.5f - f.centre.x, float(int(y)) + 0.5f - f.centre.y, n, row);
    if (row.mirroredRed == nullptr) return;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        row.red[i] += row.mirroredRed[i];
        row.green[i] += row.mirroredGreen[i];
        row.blue[i] += row.mirroredBlue[i];
    }
}
