// Texture sampling of the cpu backend: trilinear, from the finest tiles that are there. Included by kernels.inl.

struct Sampled {
    float r, g, b, a;
};

[[gnu::always_inline]] inline bool sampleLevel(const Tables& tables, const TextureSet& set, const TextureInfo& info,
                                               uint32_t level, float u, float v, Sampled& out) {
    const TextureTap tap = textureTap(info, level, u, v);
    const uint32_t* texels = set.tiles[tap.tile];
    if (texels == nullptr) return false;
    const uint32_t* at = texels + tap.y * kTileEdge + tap.x;
    const uint32_t c[4] = {at[0], at[1], at[kTileEdge], at[kTileEdge + 1]};
    const float w[4] = {(1 - tap.fx) * (1 - tap.fy), tap.fx * (1 - tap.fy), (1 - tap.fx) * tap.fy, tap.fx * tap.fy};
    out = {0, 0, 0, 0};
    const float* const decode = info.isColour != 0 ? tables.linear.data() : tables.unit.data();
    for (int k = 0; k < 4; ++k) {
        out.r += w[k] * decode[c[k] & 255u];
        out.g += w[k] * decode[c[k] >> 8 & 255u];
        out.b += w[k] * decode[c[k] >> 16 & 255u];
        out.a += w[k] * tables.unit[c[k] >> 24];
    }
    return true;
}

/// `slot` names a texture; `footprint`: texture coordinates per pixel (the longer edge). False if nothing is there yet.
inline bool sampleTexture(const Tables& tables, const TextureSet& set, const TextureSlot& slot, float u, float v,
                          float footprint, Sampled& out) {
    const TextureInfo& info = set.infos[slot.texture - 1];
    const float su = slot.rowU.x * u + slot.rowU.y * v + slot.rowU.z, sv = slot.rowV.x * u + slot.rowV.y * v + slot.rowV.z;
    const uint32_t size = info.width > info.height ? info.width : info.height;
    const float lod = min(textureLod(footprint * static_cast<float>(size)), static_cast<float>(info.levels - 1));
    uint32_t level = static_cast<uint32_t>(lod);
    const float between = lod - static_cast<float>(level);
    bool isExact = sampleLevel(tables, set, info, level, su, sv, out);
    bool isThere = isExact;
    while (!isThere && level + 1 < info.levels) isThere = sampleLevel(tables, set, info, ++level, su, sv, out);
    Sampled coarse{};
    if (isExact && between > 0 && level + 1 < info.levels && sampleLevel(tables, set, info, level + 1, su, sv, coarse)) {
        out.r += between * (coarse.r - out.r);
        out.g += between * (coarse.g - out.g);
        out.b += between * (coarse.b - out.b);
        out.a += between * (coarse.a - out.a);
    }
    return isThere;
}
