// The pixels of a tile's row that show elevation patches: normal and colour. Included by kernels.inl.

/// Follows the pointers.
[[gnu::always_inline]] inline void gatherPatches(const PatchSource* blocks, const WinningPixels& p, Corners& c) {
    const size_t n = p.count;
    for (size_t i = 0; i < n; ++i) {
        const PatchSource& source = blocks[p.id[i] / kBlockLanes];
        const PatchBlock& block = *source.block;
        const uint32_t t = cornersOf(block, p.id[i] % kBlockLanes);
        const int i0 = static_cast<int>(block.place & 0xffffu), j0 = static_cast<int>(block.place >> 16);
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t s = t >> (8 * k) & 255u;
            const vec3 place =
                meshPosition(i0 + static_cast<int>(s % kPatchStride), j0 + static_cast<int>(s / kPatchStride),
                             patchHeight(block, s), *source.mesh);
            c.x[k][i] = place.x;
            c.y[k][i] = place.y;
            c.z[k][i] = place.z;
            c.normal[k][i] = block.normals[s];
            c.colour[k][i] = block.colours[s];
            const vec2 finish = patchFinish(source.materialOf(s));  // mixed as texture coordinates are
            c.u[k][i] = finish.x;
            c.v[k][i] = finish.y;
        }
    }
}

/// Surfaces that are lit and send no light of their own.
[[gnu::always_inline]] inline void clearLight(const WinningPixels& p, bool hasEmission, MaterialRow& __restrict s) {
    for (size_t i = 0; i < p.count; ++i) s.flags[i] = 0;
    for (size_t i = 0; hasEmission && i < p.count; ++i) s.emissionR[i] = s.emissionG[i] = s.emissionB[i] = 0;
}

/// From the directions of patches to those of the camera. `finish`: metallic and roughness. What has no material is lit
/// by the formula of points, as those that no patch fits are beside it.
[[gnu::always_inline]] inline void turnPatches(const PatchSource* blocks, const WinningPixels& p, const UvRow& finish,
                                               MaterialRow& __restrict s) {
    for (size_t i = 0; i < p.count; ++i) {
        const PatchSource& source = blocks[p.id[i] / kBlockLanes];
        const DrawMesh& m = *source.mesh;
        const float x = s.nx[i], y = s.ny[i], z = s.nz[i];
        s.nx[i] = m.normalX.x * x + m.normalY.x * y + m.normalZ.x * z;
        s.ny[i] = m.normalX.y * x + m.normalY.y * y + m.normalZ.y * z;
        s.nz[i] = m.normalX.z * x + m.normalY.z * y + m.normalZ.z * z;
        s.metallic[i] = finish.u[i];
        s.roughness[i] = finish.v[i];
        s.occlusion[i] = 1;
        s.flags[i] = source.materialOf(0) == kPlainPoint ? 0u : kPixelTriangle | s.flags[i];
    }
}

/// Direct interpolation: attributes below the place where a ray meets a disc, from the four samples around it.
void mixDirect(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, const RowRays& rays,
               MaterialRow& out, UvRow& finish) {
    for (size_t k = 0; k < p.count; ++k) {
        const PatchSource& source = in.patchBlocks[p.id[k] / kBlockLanes];
        const PatchBlock& block = *source.block;
        const DrawMesh& m = *source.mesh;
        const uint32_t s = p.id[k] % kBlockLanes;
        const int i0 = static_cast<int>(block.place & 0xffffu), j0 = static_cast<int>(block.place >> 16);
        const vec3 place = meshPosition(i0 + static_cast<int>(s % kPatchStride),
                                        j0 + static_cast<int>(s / kPatchStride), patchHeight(block, s), m);
        const PatchDisc disc = discSplat(block, place, s, cellsAround(block, s), m).disc;
        const PixelRay ray = rays.at(p.pixel[k]);
        const vec3 hit = patchDiscHit(disc, m, ray, f.nearPlane);
        const PatchMix mix = patchMix(hit);
        vec3 normal = vec3(0, 0, 0), colour = vec3(0, 0, 0);
        float metallic = 0, roughness = 0;
        for (uint32_t c = 0; c < 4; ++c) {
            const uint32_t at = mix.first + c % 2 + kPatchStride * (c / 2);
            const float w = mix.weight[c];  // all four are there: the cell is drawn
            const vec3 n = octDecode(block.normals[at]);
            const auto linear = [&](uint32_t shift) {
                return linearFromByte(float(int(block.colours[at] >> shift & 255u)) * (1.0f / 255.0f));
            };
            const vec2 of = patchFinish(source.materialOf(at));
            metallic += w * of.x;
            roughness += w * of.y;
            normal = vec3(normal.x + w * n.x, normal.y + w * n.y, normal.z + w * n.z);
            colour = vec3(colour.x + w * linear(0), colour.y + w * linear(8), colour.z + w * linear(16));
        }
        out.nx[k] = normal.x;
        out.ny[k] = normal.y;
        out.nz[k] = normal.z;
        out.faceX[k] = disc.normal.x;
        out.faceY[k] = disc.normal.y;
        out.faceZ[k] = disc.normal.z;
        out.red[k] = colour.x;
        out.green[k] = colour.y;
        out.blue[k] = colour.z;
        finish.u[k] = metallic;
        finish.v[k] = roughness;
        if (source.map == nullptr) continue;
        const float cells = discFootprint(ray, rays.inverseFocal, disc.centre, disc.normal, m);
        showMap(source, hit.y, hit.z, cells, k, out, finish);
    }
}

void resolvePatches(const FrameConstants& f, const ResolveInput& in, const WinningPixels& p, uint32_t x0, uint32_t y,
                    TexelRow& __restrict row, const SurfacePlanes& planes) {
    TriangleRow t;
    const RowRays rays = rowRays(f, x0, y);
    clearLight(p, planes.emissive != nullptr, t.material);
    if (f.patchAs == kPatchDirect) {
        mixDirect(f, in, p, rays, t.material, t.uv);
    } else {
        gatherPatches(in.patchBlocks, p, t.corners);
        weighCorners(p, rays, t.corners, t.material, t.uv, t.wb, t.wc);
        for (size_t i = 0; i < p.count; ++i) t.material.red[i] = t.material.green[i] = t.material.blue[i] = 1;
        mixColours(p, t.corners, t.wb, t.wc, t.material);
        showMaps(in.patchBlocks, p, rays, t.corners, t.wb, t.wc, t.material, t.uv);
    }
    turnPatches(in.patchBlocks, p, t.uv, t.material);
    packSurfaces(p, rays, t.material, t.perpX, t.perpY, t.word);
    debugColours(f, in.patchBlocks, p, t.material);
    storeTriangles(p, t, row, planes);
}
