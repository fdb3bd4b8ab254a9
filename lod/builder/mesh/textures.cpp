// Textures to mip tiles: levels by box filter (colours in linear light, normals as vectors), tiles with a border that
// repeats what the wrap mode puts there.
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/base/numbers.h"
#include "lod/builder/mesh/mesh_work.h"
#include "lod/store/store.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

using Image = TextureImage;

glm::vec4 load(const Image& image, uint32_t x, uint32_t y) {
    const uint32_t c = image.rgba[size_t{std::min(y, image.height - 1)} * image.width + std::min(x, image.width - 1)];
    glm::vec4 v(0);
    for (int k = 0; k < 4; ++k) {
        const float s = static_cast<float>(c >> (8 * k) & 255u) / 255.0f;
        v[k] = image.kind == TextureKind::colour && k < 3 ? shared::linearFromSrgb(s) : s;
    }
    if (image.kind == TextureKind::normal) v = glm::vec4(glm::vec3(v) * 2.0f - 1.0f, v.w);
    return v;
}

uint32_t store(const Image& image, glm::vec4 v) {
    if (image.kind == TextureKind::normal) {
        const glm::vec3 n(v);
        const float length = glm::length(n);
        v = glm::vec4((length > 1e-6f ? n / length : glm::vec3(0, 0, 1)) * 0.5f + 0.5f, v.w);
    }
    uint32_t c = 0;
    for (int k = 0; k < 4; ++k) {
        const float s = v[k] > 0.0f ? std::min(v[k], 1.0f) : 0.0f;
        const float code = image.kind == TextureKind::colour && k < 3 ? shared::srgbFromLinear(s) : s;
        c |= unitToByte(code) << (8 * k);
    }
    return c;
}

Image halved(const Image& fine, Executor& executor) {
    Image out = fine;
    out.width = shared::levelSize(fine.width, 1);
    out.height = shared::levelSize(fine.height, 1);
    out.rgba.assign(size_t{out.width} * out.height, 0);
    executor.parallelFor(out.height, 16, [&](size_t begin, size_t end) {
        for (auto y = static_cast<uint32_t>(begin); y < end; ++y)
            for (uint32_t x = 0; x < out.width; ++x) {
                const glm::vec4 sum = load(fine, 2 * x, 2 * y) + load(fine, 2 * x + 1, 2 * y) +
                                      load(fine, 2 * x, 2 * y + 1) + load(fine, 2 * x + 1, 2 * y + 1);
                out.rgba[size_t{y} * out.width + x] = store(out, 0.25f * sum);
            }
    });
    return out;
}

bool isSeen(uint32_t texel, float cutoff) { return static_cast<float>(texel >> 24) / 255.0f >= cutoff; }

/// Share of the texels that `cutoff` lets be seen.
double seenShare(const Image& image, float cutoff) {
    const auto seen =
        std::count_if(image.rgba.begin(), image.rgba.end(), [&](uint32_t c) { return isSeen(c, cutoff); });
    return static_cast<double>(seen) / static_cast<double>(image.rgba.size());
}

/// A coarse level of which as much is seen as of the finest one: means of what is thin would all be below the cutoff
/// (Castano 2010). Those texels are seen whose alpha is largest; of equal ones, which a scale could not tell apart,
/// some.
Image withSeenShare(Image level, float cutoff, double share) {
    const auto count = toWhole<size_t>(std::round(share * static_cast<double>(level.rgba.size())));
    std::vector<std::pair<uint32_t, uint32_t>> order;  // alpha and a number of the texel's own, its place
    for (uint32_t i = 0; i < level.rgba.size(); ++i) {
        constexpr uint32_t kAbout = 12;  // of 255: so near are they equal
        uint32_t h = (i + 1) * 0x9e3779b1u;
        h = (h ^ h >> 15) * 0x85ebca6bu;
        order.emplace_back((level.rgba[i] >> 24 << 8) + (h >> 16) * kAbout / 256, i);
    }
    const auto middle = order.begin() + static_cast<std::ptrdiff_t>(std::min(count, order.size()));
    std::nth_element(order.begin(), middle, order.end(), std::greater<>());
    const auto below = static_cast<uint32_t>(std::max(std::ceil(255.0f * cutoff) - 1, 0.0f));
    for (auto at = order.begin(); at != order.end(); ++at) {
        uint32_t& c = level.rgba[at->second];
        if (at < middle && !isSeen(c, cutoff))
            c |= 0xff000000u;
        else if (at >= middle && isSeen(c, cutoff))
            c = (c & 0xffffffu) | below << 24;
    }
    return level;
}

uint32_t wrapped(int64_t i, uint32_t size, uint32_t wrap) {
    const auto n = static_cast<int64_t>(size);
    if (wrap == shared::kWrapClamp) return static_cast<uint32_t>(std::clamp<int64_t>(i, 0, n - 1));
    if (wrap == shared::kWrapRepeat) return static_cast<uint32_t>((i % n + n) % n);
    const int64_t m = (i % (2 * n) + 2 * n) % (2 * n);
    return static_cast<uint32_t>(m < n ? m : 2 * n - 1 - m);
}

}  // namespace

std::vector<float> cutoffsOf(const StoreDescription& description, size_t textures) {
    std::vector<float> cutoffs(textures, 0);
    for (size_t i = 0; i < description.materials.size(); ++i) {
        const shared::SurfaceMaterial& m = description.materials[i];
        if (!description.optics.empty() && description.optics[i].blends) continue;  // a mean of alpha is right
        const uint32_t texture = m.baseTexture.texture;
        if (!(m.alphaCutoff > 0) || !(m.alpha > 0) || texture == 0 || texture > textures) continue;
        float& cutoff = cutoffs[texture - 1];
        cutoff = std::max(cutoff, std::min(m.alphaCutoff / m.alpha, 1.0f));
    }
    return cutoffs;
}

Result<void> writeTextures(const std::vector<TextureImage>& images, const std::vector<float>& cutoffs,
                           StoreWriter& writer, Hierarchy& h, Executor& executor) {
    for (size_t i = 0; i < images.size(); ++i) {
        const Image& image = images[i];
        const float cutoff = cutoffs[i];
        shared::TextureInfo info{};
        const bool isEmpty = image.width == 0 || image.height == 0;
        Image level = image;
        if (isEmpty) {  // white, or straight up
            level.width = level.height = 1;
            level.rgba = {image.kind == TextureKind::normal ? 0xffff8080u : ~0u};
        }
        const double share = cutoff > 0 ? seenShare(level, cutoff) : 1;
        Image mean = cutoff > 0 ? level : Image{};  // of which coarser levels are made
        info.width = level.width;
        info.height = level.height;
        info.wrapU = image.wrapU;
        info.wrapV = image.wrapV;
        info.isColour = image.kind == TextureKind::colour ? 1 : 0;
        for (uint32_t l = 0; l < shared::kTextureLevels; ++l) {
            info.firstTile[l] = static_cast<uint32_t>(h.tiles.size());
            info.levels = l + 1;
            const uint32_t across = shared::tilesAcross(level.width, 0), down = shared::tilesAcross(level.height, 0);
            std::vector<std::vector<uint8_t>> encoded(size_t{across} * down);
            executor.parallelFor(encoded.size(), 1, [&](size_t begin, size_t end) {
                std::vector<uint32_t> texels(size_t{shared::kTileEdge} * shared::kTileEdge);
                for (size_t t = begin; t < end; ++t) {
                    const int64_t x0 = static_cast<int64_t>(t % across) * shared::kTileTexels - 1,
                                  y0 = static_cast<int64_t>(t / across) * shared::kTileTexels - 1;
                    for (uint32_t y = 0; y < shared::kTileEdge; ++y)
                        for (uint32_t x = 0; x < shared::kTileEdge; ++x)
                            texels[size_t{y} * shared::kTileEdge + x] =
                                level.rgba[size_t{wrapped(y0 + y, level.height, info.wrapV)} * level.width +
                                           wrapped(x0 + x, level.width, info.wrapU)];
                    encoded[t] = encodeTile(texels);
                }
            });
            for (const auto& bytes : encoded) {
                Node place;
                STIPPLE_TRY(writer.appendChunk(bytes, {}, place));
                h.tiles.push_back({place.chunkOffset, place.chunkHash, place.chunkBytes, 0});
            }
            if (level.width <= 1 && level.height <= 1) break;
            if (across == 1 && down == 1 && level.width <= 8 && level.height <= 8) break;  // small enough to stop
            if (cutoff > 0) {
                mean = halved(mean, executor);
                level = withSeenShare(mean, cutoff, share);
            } else {
                level = halved(level, executor);
            }
        }
        h.textures.push_back(info);
    }
    return {};
}

}  // namespace stipple::lod
