// Maps of patches (shaders/shared/patch_map.h) at the pixels of a row. Included by kernels.inl.

/// What a map shows of a place.
struct MapLook {
    vec3 colour, normal;  ///< linear; of (U, V, N), any length
    vec2 finish;          ///< metallic and roughness
};

/// i, j: samples from the block's first one; `cells`: that a pixel covers there.
MapLook mapLook(const uint32_t* map, uint32_t code, float i, float j, float cells) {
    const uint32_t density = code & kMapDensity, normals = mapTexels(density);
    const MapLod lod = mapLod(density, cells);
    MapLook out{vec3(0, 0, 0), vec3(0, 0, 0), vec2(0, 0)};
    for (uint32_t l = 0; l < 2; ++l) {
        const float share = l == 0 ? 1.0f - lod.share : lod.share;
        if (!(share > 0.0f)) continue;
        const MapTap tap = mapTap(density, l == 0 ? lod.level : lod.next, i, j);
        for (uint32_t c = 0; c < 4; ++c) {
            const float w = share * mapWeight(tap, c);
            const uint32_t texel = map[mapTexelOf(tap, c)];
            const auto linear = [&](uint32_t shift) {
                return linearFromByte(float(int(texel >> shift & 255u)) * (1.0f / 255.0f));
            };
            out.colour =
                vec3(out.colour.x + w * linear(0), out.colour.y + w * linear(8), out.colour.z + w * linear(16));
            const vec2 finish = patchMapFinish(texel);
            out.finish = vec2(out.finish.x + w * finish.x, out.finish.y + w * finish.y);
            if ((code & kMapNormals) == 0) continue;
            const vec3 n = octDecode(map[normals + mapTexelOf(tap, c)]);
            out.normal = vec3(out.normal.x + w * n.x, out.normal.y + w * n.y, out.normal.z + w * n.z);
        }
    }
    return out;
}

/// What a place sends by itself, and how much of it is not lit.
struct MapLight {
    vec3 emission;  ///< linear
    float unlit;
};

MapLight mapLight(const uint32_t* map, uint32_t code, float i, float j, float cells) {
    const uint32_t density = code & kMapDensity, first = mapLightFirst(code);
    const MapLod lod = mapLod(density, cells);
    MapLight out{vec3(0, 0, 0), 0};
    for (uint32_t l = 0; l < 2; ++l) {
        const float share = l == 0 ? 1.0f - lod.share : lod.share;
        if (!(share > 0.0f)) continue;
        const MapTap tap = mapTap(density, l == 0 ? lod.level : lod.next, i, j);
        for (uint32_t c = 0; c < 4; ++c) {
            const float w = share * mapWeight(tap, c);
            const uint32_t word = map[first + mapTexelOf(tap, c)];
            const vec3 e = mapEmission(word);
            out.emission = vec3(out.emission.x + w * e.x, out.emission.y + w * e.y, out.emission.z + w * e.z);
            out.unlit += (word & kMapUnlit) != 0 ? w : 0.0f;
        }
    }
    return out;
}

/// Of one pixel.
void showLight(const PatchSource& source, float i, float j, float cells, size_t k, MaterialRow& out) {
    const MapLight light = mapLight(source.map, source.block->map, i, j, cells);
    out.emissionR[k] = light.emission.x;
    out.emissionG[k] = light.emission.y;
    out.emissionB[k] = light.emission.z;
    out.flags[k] = light.unlit >= 0.5f ? kPixelUnlit : 0u;
}

/// Of one pixel, in the place of what its samples show.
void showMap(const PatchSource& source, float i, float j, float cells, size_t k, MaterialRow& out, UvRow& finish) {
    const uint32_t code = source.block->map;
    if (source.hasLight) showLight(source, i, j, cells, k, out);
    if ((code & kMapDensity) == 0) return;
    const MapLook look = mapLook(source.map, code, i, j, cells);
    out.red[k] = look.colour.x;
    out.green[k] = look.colour.y;
    out.blue[k] = look.colour.z;
    if ((code & kMapNormals) != 0) {
        out.nx[k] = look.normal.x;
        out.ny[k] = look.normal.y;
        out.nz[k] = look.normal.z;
    }
    if ((code & kMapMaterials) == 0 || source.materials == nullptr) return;
    finish.u[k] = look.finish.x;
    finish.v[k] = look.finish.y;
}

/// Samples of a triangle's corners, 8 bits each.
[[gnu::always_inline]] inline uint32_t cornersOf(const PatchBlock& block, uint32_t lane) {
    const uint32_t at = cellCorner(lane / 2);
    return patchTriangle(at, patchHeight(block, at), patchHeight(block, at + 1), patchHeight(block, at + kPatchStride),
                         patchHeight(block, at + kPatchStride + 1), lane & 1u);
}

/// Of the pixels whose patches have maps. `wb`, `wc`: weights of the second and third corner.
void showMaps(const PatchSource* blocks, const WinningPixels& p, const RowRays& rays, const Corners& c, const float* wb,
              const float* wc, MaterialRow& out, UvRow& finish) {
    for (size_t k = 0; k < p.count; ++k) {
        const PatchSource& source = blocks[p.id[k] / kBlockLanes];
        if (source.map == nullptr) continue;
        const uint32_t t = cornersOf(*source.block, p.id[k] % kBlockLanes);
        vec2 at[3];
        vec3 place[3];
        for (uint32_t n = 0; n < 3; ++n) {
            const uint32_t s = t >> (8 * n) & 255u;
            at[n] = vec2(float(int(s % kPatchStride)), float(int(s / kPatchStride)));
            place[n] = vec3(c.x[n][k], c.y[n][k], c.z[n][k]);
        }
        const vec2 d1 = vec2(at[1].x - at[0].x, at[1].y - at[0].y), d2 = vec2(at[2].x - at[0].x, at[2].y - at[0].y);
        const auto edge = [&](uint32_t n) {
            return vec3(place[n].x - place[0].x, place[n].y - place[0].y, place[n].z - place[0].z);
        };
        const float cells = uvFootprint(rays.at(p.pixel[k]), rays.inverseFocal, place[0], edge(1), edge(2), d1, d2);
        showMap(source, at[0].x + wb[k] * d1.x + wc[k] * d2.x, at[0].y + wb[k] * d1.y + wc[k] * d2.y, cells, k, out,
                finish);
    }
}
