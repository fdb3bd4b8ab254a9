// Texture sampling of the cpu backend: trilinear, from the finest tiles that are there. Included by kernels.inl.

struct Sampled {
    float r, g, b, a;
};

typedef float Four __attribute__((vector_size(16)));

typedef uint8_t FourBytes __attribute__((vector_size(4)));

/// Channels of a texel: colours through a table, numbers as bytes / 255.
[[gnu::always_inline]] inline Four decodeColour(const Tables& tables, uint32_t c) {
    const float *const linear = tables.linear.data(), *const unit = tables.unit.data();
    return Four{linear[c & 255u], linear[c >> 8 & 255u], linear[c >> 16 & 255u], unit[c >> 24]};
}
[[gnu::always_inline]] inline Four decodeNumbers(uint32_t c) {
    return __builtin_convertvector(__builtin_bit_cast(FourBytes, c), Four) * (1.0f / 255.0f);
}
template <typename Decode>
[[gnu::always_inline]] inline Four bilinear(const uint32_t* at, const TextureTap& tap, const Decode& decode) {
    const Four a = decode(at[0]), b = decode(at[1]), c = decode(at[kTileEdge]), d = decode(at[kTileEdge + 1]);
    const Four upper = a + (b - a) * tap.fx, lower = c + (d - c) * tap.fx;
    return upper + (lower - upper) * tap.fy;
}

[[gnu::always_inline]] inline bool sampleLevel(const Tables& tables, const TextureSet& set, const TextureInfo& info,
                                               uint32_t level, float u, float v, Four& out) {
    const TextureTap tap = textureTap(info, level, u, v);
    const uint32_t* texels = set.tiles[tap.tile];
    if (texels == nullptr) return false;
    const uint32_t* at = texels + tap.y * kTileEdge + tap.x;
    out = info.isColour != 0 ? bilinear(at, tap, [&](uint32_t c) { return decodeColour(tables, c); })
                             : bilinear(at, tap, [](uint32_t c) { return decodeNumbers(c); });
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
