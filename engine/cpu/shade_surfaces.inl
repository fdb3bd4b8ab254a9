// Light on the pixels of a row: triangles, and points under lights of the scene's own. Included by kernels.inl.

constexpr uint32_t kPlainSurface = 0x00ffff00u;  ///< not metallic, rough, not occluded: what points are

void shadeSurfaces(const FrameConstants& f, const TexelRow& __restrict row, const uint32_t* __restrict words,
                   const uint32_t* __restrict shines, const LightInput& input, const uint32_t* __restrict mask,
                   uint32_t x0, float vy, uint32_t n, float* __restrict red, float* __restrict green,
                   float* __restrict blue) {
    const float inverseFocal = 1.0f / f.focal;
    alignas(64) float r[kTile], g[kTile], b[kTile];
    const auto surfaceAt = [&](size_t i) {
        const float vx = (float(int(x0) + int(i)) + 0.5f - f.centre.x) * inverseFocal;
        const float inverse = 1.0f / std::sqrt(vx * vx + vy * vy + 1.0f);
        const vec3 ray = vec3(vx * inverse, vy * inverse, inverse);
        Surface s;
        s.colour = vec3(red[i], green[i], blue[i]);
        s.normal = normalFromPerp(vec2(row.perpX[kPad + i], row.perpY[kPad + i]), ray);
        s.toEye = vec3(-ray.x, -ray.y, -ray.z);
        s.metallic = float(int(words[i] & 255u)) * (1.0f / 255.0f);
        s.roughness = float(int(words[i] >> 8 & 255u)) * (1.0f / 255.0f);
        s.occlusion = float(int(words[i] >> 16 & 255u)) * (1.0f / 255.0f);
        s.leaf = isLeaf(row.thickness[kPad + i], row.radius[kPad + i]);
        return s;
    };
    const float ambient = f.ambient;
    const vec3 up = f.skyDirection;
    if (input.environment != nullptr) {
        for (size_t i = 0; i < n; ++i) {
            if (mask[i] == 0) continue;
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
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const float z = row.depth[kPad + i];
            const float vx = (float(int(x0) + int(i)) + 0.5f - f.centre.x) * inverseFocal;
            const vec3 point = vec3(vx * z, vy * z, z);
            const bool isFar = light.kind == kLightDirectional;
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
        if (mask[i] == 0) continue;
        red[i] = r[i] + unpackRed(shines[i]);
        green[i] = g[i] + unpackGreen(shines[i]);
        blue[i] = b[i] + unpackBlue(shines[i]);
    }
}
