// Texture sampling of the cpu backend: trilinear, from the finest tiles that are there. Included by kernels.inl.

struct Sampled {
    float r, g, b, a;
};

typedef float Four __attribute__((vector_size(16)));

/// Channels of a texel: the tables hold the same for all four, so that one load and one product do for all.
[[gnu::always_inline]] inline Four decodeTexel(const float* decode, const float* unit, uint32_t c) {
    return Four{decode[c & 255u], decode[c >> 8 & 255u], decode[c >> 16 & 255u], unit[c >> 24]};
}

[[gnu::always_inline]] inline bool sampleLevel(const Tables& tables, const TextureSet& set, const TextureInfo& info,
                                               uint32_t level, float u, float v, Four& out) {
    const TextureTap tap = textureTap(info, level, u, v);
    const uint32_t* texels = set.tiles[tap.tile];
    if (texels == nullptr) return false;
    const uint32_t* at = texels + tap.y * kTileEdge + tap.x;
    const float* const unit = tables.unit.data();
    const float* const decode = info.isColour != 0 ? tables.linear.data() : unit;
    const Four a = decodeTexel(decode, unit, at[0]), b = decodeTexel(decode, unit, at[1]),
               c = decodeTexel(decode, unit, at[kTileEdge]), d = decodeTexel(decode, unit, at[kTileEdge + 1]);
    const Four upper = a + (b - a) * tap.fx, lower = c + (d - c) * tap.fx;
    out = upper + (lower - upper) * tap.fy;
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
    Four fine{}, coarse{};
    const bool isExact = sampleLevel(tables, set, info, level, su, sv, fine);
    bool isThere = isExact;
    while (!isThere && level + 1 < info.levels) isThere = sampleLevel(tables, set, info, ++level, su, sv, fine);
    if (isExact && between > 0 && level + 1 < info.levels && sampleLevel(tables, set, info, level + 1, su, sv, coarse))
        fine += (coarse - fine) * between;
    out = {fine[0], fine[1], fine[2], fine[3]};
    return isThere;
}
