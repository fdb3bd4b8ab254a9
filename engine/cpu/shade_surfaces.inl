// Light on the pixels of a row: triangles, and points under lights of the scene's own. Included by kernels.inl.

constexpr uint32_t kPlainSurface = 0x00ffff00u;  ///< not metallic, rough, not occluded: what points are

/// The pixels of a row that are lit, closed up: of a forest's ground there may be few in each row.
struct alignas(64) LitPixels {
    uint32_t at[kTile];
    float x[kTile], depth[kTile], nx[kTile], ny[kTile], nz[kTile], leaf[kTile];
    float red[kTile], green[kTile], blue[kTile];
    uint32_t words[kTile];
};

/// `flat`: 0 where a pixel shows a tube; (offX, offY): the first pixel's centre, px from the principal point.
void shadeSurfaces(const FrameConstants& f, const TexelRow& __restrict row, const float* __restrict flat,
                   const uint32_t* __restrict words, const uint32_t* __restrict shines, const LightInput& input,
                   const uint32_t* __restrict mask, float offX, float offY, uint32_t pixels, float* __restrict red,
                   float* __restrict green, float* __restrict blue) {
    const float focal = f.focal, inverseFocal = 1.0f / focal, vy = offY * inverseFocal;
    LitPixels p;
    size_t n = 0;
    for (uint32_t i = 0; i < pixels; ++i) {
        if (mask[i] == 0) continue;
        const size_t from = kPad + i;
        p.at[n] = i;
        const float x = offX + float(int(i));
        const vec3 normal = normalAt(row, from, flat[i], x, offY, focal);
        p.x[n] = x;
        p.depth[n] = depthAt(row, from, flat[i], x, offY, focal);
        p.nx[n] = normal.x;
        p.ny[n] = normal.y;
        p.nz[n] = normal.z;
        p.leaf[n] = letsLightThrough(row.thickness[from], row.radius[from], row.isRound[from],
                                     row.hasTubes ? row.axisX[from] : 0.0f);
        p.red[n] = red[i];
        p.green[n] = green[i];
        p.blue[n] = blue[i];
        p.words[n++] = words[i];
    }
    alignas(64) float r[kTile], g[kTile], b[kTile];
    const float *const px = p.x, *const depth = p.depth, *const nx = p.nx, *const ny = p.ny, *const nz = p.nz,
                       *const leaf = p.leaf, *const pr = p.red, *const pg = p.green, *const pb = p.blue;
    const uint32_t* const word = p.words;
    const auto surfaceAt = [=](size_t i) {
        const float vx = px[i] * inverseFocal;
        const float inverse = 1.0f / std::sqrt(vx * vx + vy * vy + 1.0f);
        const vec3 ray = vec3(vx * inverse, vy * inverse, inverse);
        Surface s;
        s.colour = vec3(pr[i], pg[i], pb[i]);
        s.normal = vec3(nx[i], ny[i], nz[i]);
        s.toEye = vec3(-ray.x, -ray.y, -ray.z);
        s.metallic = float(int(word[i] & 255u)) * (1.0f / 255.0f);
        s.roughness = float(int(word[i] >> 8 & 255u)) * (1.0f / 255.0f);
        s.occlusion = float(int(word[i] >> 16 & 255u)) * (1.0f / 255.0f);
        s.leaf = leaf[i];
        return s;
    };
    const float ambient = f.ambient;
    const vec3 up = f.skyDirection;
    if (input.environment != nullptr) {
        for (size_t i = 0; i < n; ++i) {
            const vec3 c =
                reflectEnvironment(input.environment, surfaceAt(i), f.environmentX, f.environmentY, f.environmentZ);
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
    for (uint32_t k = 0; k < f.lightCount; ++k) {
        const LightSource light = input.lights[k];
        const bool isFar = light.kind == kLightDirectional;
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const float z = depth[i];
            const float vx = px[i] * inverseFocal;
            const vec3 point = vec3(vx * z, vy * z, z);
            vec3 l = vec3(light.position.x - (isFar ? 0.0f : point.x), light.position.y - (isFar ? 0.0f : point.y),
                          light.position.z - (isFar ? 0.0f : point.z));
            const float inverse = 1.0f / std::sqrt(max(l.x * l.x + l.y * l.y + l.z * l.z, 1.0e-12f));
            l = vec3(l.x * inverse, l.y * inverse, l.z * inverse);
            const float share = lightAt(light, point, z);
            const vec3 c = reflectLight(surfaceAt(i), l,
                                        vec3(light.colour.x * share, light.colour.y * share, light.colour.z * share));
            r[i] += c.x;
            g[i] += c.y;
            b[i] += c.z;
        }
    }
    for (size_t i = 0; i < n; ++i) {
        const uint32_t at = p.at[i];
        red[at] = r[i] + unpackRed(shines[at]);
        green[at] = g[i] + unpackGreen(shines[at]);
        blue[at] = b[i] + unpackBlue(shines[at]);
    }
}
