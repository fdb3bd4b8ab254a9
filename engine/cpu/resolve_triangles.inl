// The pixels of a tile's row that show triangles: corners, weights, normal and colour. Included by kernels.inl.
//
// Everything but following pointers is a loop over the row's pixels that becomes SIMD; materials and textures are
// looked at once for every run of pixels that share them.

/// What the weights mix, corner by corner.
struct Corners {
    alignas(64) float x[3][kSpreadRow], y[3][kSpreadRow], z[3][kSpreadRow];
    alignas(64) float u[3][kSpreadRow], v[3][kSpreadRow];
    alignas(64) uint32_t normal[3][kSpreadRow], colour[3][kSpreadRow];
};

/// A material's properties at the pixels, and what the shading needs of the surface.
struct MaterialRow {
    alignas(64) float nx[kTile], ny[kTile], nz[kTile], faceX[kTile], faceY[kTile], faceZ[kTile];
    alignas(64) float red[kTile], green[kTile], blue[kTile];
    alignas(64) float metallic[kTile], roughness[kTile], occlusion[kTile];
    alignas(64) float emissionR[kTile], emissionG[kTile], emissionB[kTile];
    alignas(64) uint32_t flags[kTile];
};

/// Pixels [first, first + n) have one mesh, one material and these surface flags.
struct MaterialRun {
    const DrawMesh* mesh;
    const SurfaceMaterial* material;
    const TextureSet* textures;
    uint32_t surface;
    size_t first, n;
};

/// To the side of the interpolated normal.
[[gnu::always_inline]] inline void turnFace(MaterialRow& s, size_t i) {
    const vec3 face = faceBeside(vec3(s.faceX[i], s.faceY[i], s.faceZ[i]), vec3(s.nx[i], s.ny[i], s.nz[i]));
    s.faceX[i] = face.x;
    s.faceY[i] = face.y;
    s.faceZ[i] = face.z;
}

void applyMaterial(const MaterialRun& run, const Corners& c, const UvRow& uv, bool hasEmission,
                   MaterialRow& __restrict s) {
    const DrawMesh m = *run.mesh;
    const SurfaceMaterial& material = *run.material;
    const size_t end = run.first + run.n;
    const bool isFlat = (run.surface & kSurfaceFlat) != 0;
    const vec3 base = material.baseColour, emission = material.emissive;
    const float metallic = material.metallic, roughness = material.roughness;
    const uint32_t flags = kPixelTriangle | ((run.surface & kSurfaceUnlit) != 0 ? kPixelUnlit : 0u) | material.optics;
#pragma GCC ivdep
    for (size_t i = run.first; i < end; ++i) {
        const float x = s.nx[i], y = s.ny[i], z = s.nz[i];
        const float wx = m.normalX.x * x + m.normalY.x * y + m.normalZ.x * z,
                    wy = m.normalX.y * x + m.normalY.y * y + m.normalZ.y * z,
                    wz = m.normalX.z * x + m.normalY.z * y + m.normalZ.z * z;
        s.nx[i] = isFlat ? s.faceX[i] : wx;
        s.ny[i] = isFlat ? s.faceY[i] : wy;
        s.nz[i] = isFlat ? s.faceZ[i] : wz;
        turnFace(s, i);
        s.red[i] = base.x;
        s.green[i] = base.y;
        s.blue[i] = base.z;
        s.metallic[i] = metallic;
        s.roughness[i] = roughness;
        s.occlusion[i] = 1.0f;
        s.flags[i] = flags;
    }
    if (hasEmission)
#pragma GCC ivdep
        for (size_t i = run.first; i < end; ++i) {
            s.emissionR[i] = emission.x;
            s.emissionG[i] = emission.y;
            s.emissionB[i] = emission.z;
        }
    if ((run.surface & kSurfaceTextured) == 0) return;
    SampledRow t;
    const auto sample = [&](const TextureSlot& slot) {
        if (slot.texture != 0) sampleRow(*run.textures, slot, uv, run.first, run.n, t);
        return slot.texture != 0;
    };
    if (sample(material.baseTexture))
#pragma GCC ivdep
        for (size_t i = run.first; i < end; ++i) {
            s.red[i] *= t.isThere[i] != 0 ? t.r[i] : 1.0f;
            s.green[i] *= t.isThere[i] != 0 ? t.g[i] : 1.0f;
            s.blue[i] *= t.isThere[i] != 0 ? t.b[i] : 1.0f;
        }
    if (sample(material.surfaceTexture))
#pragma GCC ivdep
        for (size_t i = run.first; i < end; ++i) {
            s.roughness[i] *= t.isThere[i] != 0 ? t.g[i] : 1.0f;
            s.metallic[i] *= t.isThere[i] != 0 ? t.b[i] : 1.0f;
        }
    const float strength = material.occlusionStrength;
    if (sample(material.occlusionTexture))
#pragma GCC ivdep
        for (size_t i = run.first; i < end; ++i)
            s.occlusion[i] = 1.0f + strength * ((t.isThere[i] != 0 ? t.r[i] : 1.0f) - 1.0f);
    if (hasEmission && sample(material.emissiveTexture))
#pragma GCC ivdep
        for (size_t i = run.first; i < end; ++i) {
            s.emissionR[i] *= t.isThere[i] != 0 ? t.r[i] : 1.0f;
            s.emissionG[i] *= t.isThere[i] != 0 ? t.g[i] : 1.0f;
            s.emissionB[i] *= t.isThere[i] != 0 ? t.b[i] : 1.0f;
        }
    const float bend = material.normalScale;
    if (sample(material.normalTexture))
#pragma GCC ivdep
        for (size_t i = run.first; i < end; ++i) {
            const vec3 n = bumpedNormal(
                vec3(s.nx[i], s.ny[i], s.nz[i]),
                vec3(c.x[1][i] - c.x[0][i], c.y[1][i] - c.y[0][i], c.z[1][i] - c.z[0][i]),
                vec3(c.x[2][i] - c.x[0][i], c.y[2][i] - c.y[0][i], c.z[2][i] - c.z[0][i]),
                vec2(c.u[1][i] - c.u[0][i], c.v[1][i] - c.v[0][i]), vec2(c.u[2][i] - c.u[0][i], c.v[2][i] - c.v[0][i]),
                vec3((2.0f * t.r[i] - 1.0f) * bend, (2.0f * t.g[i] - 1.0f) * bend, 2.0f * t.b[i] - 1.0f));
            s.nx[i] = t.isThere[i] != 0 ? n.x : s.nx[i];
            s.ny[i] = t.isThere[i] != 0 ? n.y : s.ny[i];
            s.nz[i] = t.isThere[i] != 0 ? n.z : s.nz[i];
        }
}

/// How opaque the run's pixels are, in the place of how much of what is around reaches them (kPixelBlends).
void blendRun(const MaterialRun& run, const Corners& c, const UvRow& uv, const float* wb, const float* wc,
              MaterialRow& __restrict s) {
    const SurfaceMaterial& material = *run.material;
    alignas(64) float alpha[kTile];
    for (size_t k = 0; k < run.n; ++k) {
        const size_t i = run.first + k;
        const auto alphaOf = [&](size_t of) { return float(int(c.colour[of][i] >> 24)) * (1.0f / 255.0f); };
        alpha[k] = material.alpha * ((1.0f - wb[i] - wc[i]) * alphaOf(0) + wb[i] * alphaOf(1) + wc[i] * alphaOf(2));
    }
    if (material.baseTexture.texture != 0)
        sampleAlphas(*run.textures, material.baseTexture, uv, run.first, run.n, alpha);
    for (size_t k = 0; k < run.n; ++k) s.occlusion[run.first + k] = alpha[k];
}

/// What is known of the pixels of a row that show triangles.
struct TriangleRow {
    Corners corners;
    MaterialRow material;
    UvRow uv;
    alignas(64) float wb[kTile], wc[kTile];  ///< weights of the second and third corner
    alignas(64) uint32_t surface[kSpreadRow];  ///< flags and material
    alignas(64) float perpX[kTile], perpY[kTile];
    alignas(64) uint32_t word[kTile], emission[kTile];
};

/// Rays of the pixels of a row.
struct RowRays {
    Lens lens;
    float inverseFocal, centreX, rayY;
    [[gnu::always_inline]] PixelRay at(uint32_t pixel) const {
        return pixelRay(lens, (float(int(pixel)) - centreX) * inverseFocal, rayY);
    }
};

/// Follows the pointers; is any of them textured?
[[gnu::always_inline]] inline bool gatherCorners(const ResolveInput& in, const WinningPixels& p, Corners& c,
                                                 uint32_t* __restrict surface) {
    uint32_t anyTextured = 0;
    PixelRuns runs;
    findRuns(p, runs);
    for (uint32_t r = 0; r < runs.count; ++r) {
        const size_t first = runs.first[r], end = runs.first[r + 1];
        const MeshBlock& block = in.meshBlocks[p.id[first] / kClusterTriangles];
        const uint32_t t = block.triangles[p.id[first] % kClusterTriangles];
        const uint32_t flags = block.vertices[t & 255u].surface;
        for (uint32_t k = 0; k < 3; ++k) {
            const MeshVertex& v = block.vertices[t >> (8 * k) & 255u];
            const vec3 at = placeOf(block, t >> (8 * k) & 255u);
            for (size_t i = first; i < end; i += kSpread) {
                spread(at.x, c.x[k] + i);
                spread(at.y, c.y[k] + i);
                spread(at.z, c.z[k] + i);
                spread(v.normal, c.normal[k] + i);
                spread(v.colour, c.colour[k] + i);
                spread(v.u, c.u[k] + i);
                spread(v.v, c.v[k] + i);
            }
        }
        for (size_t i = first; i < end; i += kSpread) spread(flags, surface + i);
        anyTextured |= flags & kSurfaceTextured;
    }
    return anyTextured != 0;
}

[[gnu::always_inline]] inline void weighCorners(const WinningPixels& p, const RowRays& rays, const Corners& c,
                                                MaterialRow& s, UvRow& uv, float* __restrict wb, float* __restrict wc) {
    const size_t n = p.count;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const PixelRay ray = rays.at(p.pixel[i]);
        const vec3 a = vec3(c.x[0][i], c.y[0][i], c.z[0][i]);
        const vec2 w =
            triangleWeights(rayDirection(ray), fromRay(ray, a), fromRay(ray, vec3(c.x[1][i], c.y[1][i], c.z[1][i])),
                            fromRay(ray, vec3(c.x[2][i], c.y[2][i], c.z[2][i])));
        const vec3 n0 = octDecode(c.normal[0][i]), n1 = octDecode(c.normal[1][i]), n2 = octDecode(c.normal[2][i]);
        const float first = 1.0f - w.x - w.y;
        wb[i] = w.x;
        wc[i] = w.y;
        s.nx[i] = first * n0.x + w.x * n1.x + w.y * n2.x;
        s.ny[i] = first * n0.y + w.x * n1.y + w.y * n2.y;
        s.nz[i] = first * n0.z + w.x * n1.z + w.y * n2.z;
        uv.u[i] = first * c.u[0][i] + w.x * c.u[1][i] + w.y * c.u[2][i];
        uv.v[i] = first * c.v[0][i] + w.x * c.v[1][i] + w.y * c.v[2][i];
        const vec3 e1 = vec3(c.x[1][i] - a.x, c.y[1][i] - a.y, c.z[1][i] - a.z);
        const vec3 e2 = vec3(c.x[2][i] - a.x, c.y[2][i] - a.y, c.z[2][i] - a.z);
        s.faceX[i] = e1.y * e2.z - e1.z * e2.y;
        s.faceY[i] = e1.z * e2.x - e1.x * e2.z;
        s.faceZ[i] = e1.x * e2.y - e1.y * e2.x;
    }
}

[[gnu::always_inline]] inline void measureFootprints(const WinningPixels& p, const RowRays& rays, const Corners& c,
                                                     UvRow& uv) {
    const size_t n = p.count;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const PixelRay ray = rays.at(p.pixel[i]);
        const vec3 corner = vec3(c.x[0][i], c.y[0][i], c.z[0][i]);
        const vec3 e1 = vec3(c.x[1][i] - corner.x, c.y[1][i] - corner.y, c.z[1][i] - corner.z);
        const vec3 e2 = vec3(c.x[2][i] - corner.x, c.y[2][i] - corner.y, c.z[2][i] - corner.z);
        uv.footprint[i] =
            uvFootprint(ray, rays.inverseFocal, corner, e1, e2, vec2(c.u[1][i] - c.u[0][i], c.v[1][i] - c.v[0][i]),
                        vec2(c.u[2][i] - c.u[0][i], c.v[2][i] - c.v[0][i]));
    }
}

/// Material by material.
[[gnu::always_inline]] inline void applyMaterials(const ResolveInput& in, const WinningPixels& p, bool hasEmission,
                                                  TriangleRow& row) {
    const size_t n = p.count;
    const uint32_t* const surface = row.surface;
    for (size_t first = 0; first < n;) {
        const MeshBlock& block = in.meshBlocks[p.id[first] / kClusterTriangles];
        size_t end = first + 1;
        while (end < n && surface[end] == surface[first] &&
               in.meshBlocks[p.id[end] / kClusterTriangles].mesh == block.mesh)
            ++end;
        const MaterialRun run{
            block.mesh,     &in.materials[block.mesh->firstMaterial + (surface[first] & kSurfaceMaterialMask)],
            block.textures, surface[first],
            first,          end - first};
        applyMaterial(run, row.corners, row.uv, hasEmission, row.material);
        if (run.material->optics == kPixelBlends) blendRun(run, row.corners, row.uv, row.wb, row.wc, row.material);
        first = end;
    }
}

/// Normals and surface words.
[[gnu::always_inline]] inline void packSurfaces(const WinningPixels& p, const RowRays& rays, const MaterialRow& s,
                                                float* __restrict perpX, float* __restrict perpY,
                                                uint32_t* __restrict word) {
    const size_t n = p.count;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const vec3 ray = rayDirection(rays.at(p.pixel[i]));
        const vec3 normal =
            surfaceNormal(vec3(s.nx[i], s.ny[i], s.nz[i]), vec3(s.faceX[i], s.faceY[i], s.faceZ[i]), ray);
        const float inverseRay = 1.0f / std::sqrt(ray.x * ray.x + ray.y * ray.y + 1.0f);
        const vec2 perp = perpFromNormal(normal, vec3(ray.x * inverseRay, ray.y * inverseRay, inverseRay));
        perpX[i] = perp.x;
        perpY[i] = perp.y;
        const auto byte = [](float value) { return uint32_t(int(min(max(0.0f, value), 1.0f) * 255.0f + 0.5f)); };
        word[i] = s.flags[i] | byte(s.metallic[i]) | byte(s.roughness[i]) << 8 | byte(s.occlusion[i]) << 16;
    }
}

/// Times the colours of the corners, mixed.
[[gnu::always_inline]] inline void mixColours(const WinningPixels& p, const Corners& c, const float* __restrict wb,
                                              const float* __restrict wc, MaterialRow& s) {
    const size_t n = p.count;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) {
        const auto mix = [&](uint32_t shift) {
            const auto of = [&](size_t k) {
                return linearFromByte(float(int(c.colour[k][i] >> shift & 255u)) * (1.0f / 255.0f));
            };
            return (1.0f - wb[i] - wc[i]) * of(0) + wb[i] * of(1) + wc[i] * of(2);
        };
        s.red[i] *= mix(0);
        s.green[i] *= mix(8);
        s.blue[i] *= mix(16);
    }
}

/// Those of a debug view instead. `blocks`: of the kind.
template <typename Block>
[[gnu::always_inline]] inline void debugColours(const FrameConstants& f, const Block* blocks, const WinningPixels& p,
                                                MaterialRow& s) {
    if (f.debugView != kDebugLevel && f.debugView != kDebugError) return;
    for (size_t i = 0; i < p.count; ++i) {
        const Block& block = blocks[p.id[i] / kBlockLanes];
        const vec3 d = f.debugView == kDebugLevel ? debugLevelColour(block.level) : debugErrorColour(block.errorPixels);
        s.red[i] = d.x;
        s.green[i] = d.y;
        s.blue[i] = d.z;
    }
}

/// Rays of the pixels from (x0, y) on.
[[gnu::always_inline]] inline RowRays rowRays(const FrameConstants& f, uint32_t x0, uint32_t y) {
    const float inverseFocal = 1.0f / f.focal;
    return {lensHere(f.focal), inverseFocal, f.centre.x - float(int(x0)) - 0.5f,
            (float(int(y)) + 0.5f - f.centre.y) * inverseFocal};
}

/// Into the row's texels and the planes beside them.
void storeTriangles(const WinningPixels& p, TriangleRow& t, TexelRow& __restrict row, const SurfacePlanes& planes) {
    const MaterialRow& s = t.material;
    const size_t n = p.count;
    for (size_t i = 0; i < n; ++i) {
        const size_t at = kPad + p.pixel[i];
        row.depth[at] = p.depth[i];
        row.radius[at] = kTriangleRadius;
        row.thickness[at] = kTriangleRadius;
        row.x[at] = 0;
        row.y[at] = 0;
        row.perpX[at] = t.perpX[i];
        row.perpY[at] = t.perpY[i];
        row.red[at] = s.red[i];
        row.green[at] = s.green[i];
        row.blue[at] = s.blue[i];
        planes.surface[p.pixel[i]] = t.word[i];
    }
    if (planes.emissive == nullptr) return;
#pragma GCC ivdep
    for (size_t i = 0; i < n; ++i) t.emission[i] = packColour(s.emissionR[i], s.emissionG[i], s.emissionB[i]);
    for (size_t i = 0; i < n; ++i) planes.emissive[p.pixel[i]] = t.emission[i];
}

void resolveTriangles(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, uint32_t x0, uint32_t y,
                      TexelRow& __restrict row, const SurfacePlanes& planes) {
    TriangleRow t;
    const RowRays rays = rowRays(f, x0, y);
    const bool anyTextured = gatherCorners(in, p, t.corners, t.surface);
    weighCorners(p, rays, t.corners, t.material, t.uv, t.wb, t.wc);
    if (anyTextured) measureFootprints(p, rays, t.corners, t.uv);
    applyMaterials(in, p, planes.emissive != nullptr, t);
    packSurfaces(p, rays, t.material, t.perpX, t.perpY, t.word);
    mixColours(p, t.corners, t.wb, t.wc, t.material);
    debugColours(f, in.meshBlocks, p, t.material);
    storeTriangles(p, t, row, planes);
}
