// The pixels of a tile's row that show triangles: corners, weights, normal and colour. Included by kernels.inl.

struct TrianglePixels {
    uint32_t count;
    alignas(64) uint32_t pixel[kTile], id[kTile];
    alignas(64) float depth[kTile];
};

/// What the weights mix, corner by corner.
struct Corners {
    alignas(64) float x[3][kTile], y[3][kTile], z[3][kTile];
    alignas(64) float u[3][kTile], v[3][kTile];
    alignas(64) uint32_t normal[3][kTile];
};

void resolveTriangles(const FrameConstants& f, const Tables& tables, const ResolveInput& in, const TrianglePixels& p,
                      uint32_t x0, uint32_t y, TexelRow& __restrict row, const SurfacePlanes& planes) {
    Corners c;
    alignas(64) float nx[kTile], ny[kTile], nz[kTile], wb[kTile], wc[kTile];
    alignas(64) float mixedU[kTile], mixedV[kTile], footprint[kTile];
    uint32_t anyTextured = 0;
    const size_t n = p.count;
    for (size_t i = 0; i < n; ++i) {
        const MeshBlock& block = in.meshBlocks[p.id[i] / 256u];
        const uint32_t t = block.triangles[p.id[i] & 255u];
        const DrawMesh& m = *block.mesh;
        for (uint32_t k = 0; k < 3; ++k) {
            const MeshVertex& v = block.vertices[t >> (8 * k) & 255u];
            const vec3 at = meshPosition(v.x, v.y, v.z, m);
            c.x[k][i] = at.x;
            c.y[k][i] = at.y;
            c.z[k][i] = at.z;
            c.normal[k][i] = v.normal;
            c.u[k][i] = v.u;
            c.v[k][i] = v.v;
            anyTextured |= v.surface & kSurfaceTextured;
        }
    }
    const float inverseFocal = 1.0f / f.focal;
    const float centreX = f.centre.x - float(int(x0)) - 0.5f, rayY = (float(int(y)) + 0.5f - f.centre.y) * inverseFocal;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const vec3 ray = vec3((float(int(p.pixel[i])) - centreX) * inverseFocal, rayY, 1.0f);
        const vec2 w = triangleWeights(ray, vec3(c.x[0][i], c.y[0][i], c.z[0][i]),
                                       vec3(c.x[1][i], c.y[1][i], c.z[1][i]), vec3(c.x[2][i], c.y[2][i], c.z[2][i]));
        const vec3 n0 = octDecode(c.normal[0][i]), n1 = octDecode(c.normal[1][i]), n2 = octDecode(c.normal[2][i]);
        const float a = 1.0f - w.x - w.y;
        wb[i] = w.x;
        wc[i] = w.y;
        nx[i] = a * n0.x + w.x * n1.x + w.y * n2.x;
        ny[i] = a * n0.y + w.x * n1.y + w.y * n2.y;
        nz[i] = a * n0.z + w.x * n1.z + w.y * n2.z;
        mixedU[i] = a * c.u[0][i] + w.x * c.u[1][i] + w.y * c.u[2][i];
        mixedV[i] = a * c.v[0][i] + w.x * c.v[1][i] + w.y * c.v[2][i];
    }
    if (anyTextured != 0) {
#pragma GCC ivdep
        for (size_t i = 0; i < n; ++i) {
            const vec3 ray = vec3((float(int(p.pixel[i])) - centreX) * inverseFocal, rayY, 1.0f);
            const vec3 corner = vec3(c.x[0][i], c.y[0][i], c.z[0][i]);
            const vec3 e1 = vec3(c.x[1][i] - corner.x, c.y[1][i] - corner.y, c.z[1][i] - corner.z);
            const vec3 e2 = vec3(c.x[2][i] - corner.x, c.y[2][i] - corner.y, c.z[2][i] - corner.z);
            footprint[i] = uvFootprint(ray, inverseFocal, corner, e1, e2,
                                       vec2(c.u[1][i] - c.u[0][i], c.v[1][i] - c.v[0][i]),
                                       vec2(c.u[2][i] - c.u[0][i], c.v[2][i] - c.v[0][i]));
        }
    }
    for (size_t i = 0; i < n; ++i) {
        const MeshBlock& block = in.meshBlocks[p.id[i] / 256u];
        const uint32_t t = block.triangles[p.id[i] & 255u];
        const DrawMesh& m = *block.mesh;
        const MeshVertex &va = block.vertices[t & 255u], &vb = block.vertices[t >> 8 & 255u],
                         &vc = block.vertices[t >> 16 & 255u];
        const SurfaceMaterial& material = in.materials[m.firstMaterial + (va.surface & kSurfaceMaterialMask)];
        const vec3 ray = vec3((float(int(p.pixel[i])) - centreX) * inverseFocal, rayY, 1.0f);
        vec3 normal = vec3(m.normalX.x * nx[i] + m.normalY.x * ny[i] + m.normalZ.x * nz[i],
                           m.normalX.y * nx[i] + m.normalY.y * ny[i] + m.normalZ.y * nz[i],
                           m.normalX.z * nx[i] + m.normalY.z * ny[i] + m.normalZ.z * nz[i]);
        const vec3 e1 = vec3(c.x[1][i] - c.x[0][i], c.y[1][i] - c.y[0][i], c.z[1][i] - c.z[0][i]);
        const vec3 e2 = vec3(c.x[2][i] - c.x[0][i], c.y[2][i] - c.y[0][i], c.z[2][i] - c.z[0][i]);
        const vec3 face = vec3(e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x);
        const float a = 1.0f - wb[i] - wc[i], b = wb[i], g = wc[i];
        normal = (va.surface & kSurfaceFlat) != 0 ? face : normal;
        vec3 colour = material.baseColour, emissive = material.emissive;
        float metallic = material.metallic, roughness = material.roughness, occlusion = 1.0f;
        if ((va.surface & kSurfaceTextured) != 0) {
            const float u = mixedU[i], v = mixedV[i], texels = footprint[i];
            const float u1 = vb.u - va.u, v1 = vb.v - va.v, u2 = vc.u - va.u, v2 = vc.v - va.v;
            const TextureSet& set = *block.textures;
            Sampled s{};
            if (material.baseTexture.texture != 0 &&
                sampleTexture(tables, set, material.baseTexture, u, v, texels, s))
                colour = vec3(colour.x * s.r, colour.y * s.g, colour.z * s.b);
            if (material.surfaceTexture.texture != 0 &&
                sampleTexture(tables, set, material.surfaceTexture, u, v, texels, s)) {
                roughness *= s.g;
                metallic *= s.b;
            }
            if (material.occlusionTexture.texture != 0 &&
                sampleTexture(tables, set, material.occlusionTexture, u, v, texels, s))
                occlusion = 1.0f + material.occlusionStrength * (s.r - 1.0f);
            if (material.emissiveTexture.texture != 0 &&
                sampleTexture(tables, set, material.emissiveTexture, u, v, texels, s))
                emissive = vec3(emissive.x * s.r, emissive.y * s.g, emissive.z * s.b);
            if (material.normalTexture.texture != 0 &&
                sampleTexture(tables, set, material.normalTexture, u, v, texels, s))
                normal = bumpedNormal(normal, e1, e2, vec2(u1, v1), vec2(u2, v2),
                                      vec3((2.0f * s.r - 1.0f) * material.normalScale,
                                           (2.0f * s.g - 1.0f) * material.normalScale, 2.0f * s.b - 1.0f));
        }
        normal = surfaceNormal(normal, face, ray);
        Texel texel;
        texel.depth = p.depth[i];
        texel.radius = kTriangleRadius;
        texel.thickness = kTriangleRadius;
        texel.offset = vec2(0.0f, 0.0f);
        const float inverseRay = 1.0f / std::sqrt(ray.x * ray.x + ray.y * ray.y + 1.0f);
        texel.normalPerp = perpFromNormal(normal, vec3(ray.x * inverseRay, ray.y * inverseRay, inverseRay));
        texel.colour = colour;
        if ((va.colour & vb.colour & vc.colour & 0xffffffu) != 0xffffffu) {
            const auto mix = [&](uint32_t shift) {
                return a * tables.linear[va.colour >> shift & 255u] + b * tables.linear[vb.colour >> shift & 255u] +
                       g * tables.linear[vc.colour >> shift & 255u];
            };
            texel.colour = vec3(texel.colour.x * mix(0), texel.colour.y * mix(8), texel.colour.z * mix(16));
        }
        if (f.debugView == kDebugLevel) texel.colour = debugLevelColour(block.level);
        if (f.debugView == kDebugError) texel.colour = debugErrorColour(block.errorPixels);
        setTexel(row, kPad + p.pixel[i], texel);
        const auto byte = [](float value) { return uint32_t(int(min(max(value, 0.0f), 1.0f) * 255.0f + 0.5f)); };
        planes.surface[p.pixel[i]] = kPixelTriangle | ((va.surface & kSurfaceUnlit) != 0 ? kPixelUnlit : 0u) |
                                     byte(metallic) | byte(roughness) << 8 | byte(occlusion) << 16;
        if (planes.emissive != nullptr) planes.emissive[p.pixel[i]] = packColour(emissive.x, emissive.y, emissive.z);
    }
}
