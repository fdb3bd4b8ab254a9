#include "lod/primitives/patch_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/check.h"
#include "engine/base/numbers.h"
#include "lod/primitives/octahedral.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr size_t kMostWords = size_t{1} << (32 - shared::kMapFirstShift);

float linearOf(uint32_t byte) {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> t{};
        for (uint32_t i = 0; i < 256; ++i) t.at(i) = shared::linearFromSrgb(static_cast<float>(i) / 255.0f);
        return t;
    }();
    return table[byte & 255u];
}

/// What nine texels are together.
struct TexelMean {
    float weights = 0, rough = 0, metallic = 0, unlit = 0;
    glm::vec3 colour{0}, normal{0}, emission{0};

    void add(float w, uint32_t texel) {
        colour += w * glm::vec3(linearOf(texel), linearOf(texel >> 8), linearOf(texel >> 16));
        rough += w * static_cast<float>(texel >> 24 & 15u);
        metallic += w * static_cast<float>(texel >> 28);
    }
    void addLight(float w, uint32_t light) {
        emission += w * emissionOf(light);
        unlit += keepsColour(light) ? w : 0;
    }
    uint32_t light() const { return packLight(emission / weights, unlit >= 0.5f * weights); }
    uint32_t texel(bool hasMaterials) const {
        uint32_t out = 0;
        for (int a = 0; a < 3; ++a)
            out |= uint32_t{unitToByte(shared::srgbFromLinear(std::min(colour[a] / weights, 1.0f)))} << (8 * a);
        if (!hasMaterials) return out;
        const auto step = [&](float sum) { return toWhole<uint32_t>(std::floor(sum / weights + 0.5f)); };
        return out | step(rough) << 24 | step(metallic) << 28;
    }
};

}  // namespace

uint32_t packLight(const glm::vec3& emission, bool isUnlit) {
    if (isUnlit) return shared::kMapUnlit;
    constexpr int kMost = 15;
    const float most = std::max({emission.x, emission.y, emission.z});
    const int log2 = most > 1 ? std::min(std::isfinite(most) ? std::ilogb(most) + 1 : kMost, kMost) : 0;
    uint32_t out = 0;
    for (int a = 0; a < 3; ++a)
        out |= uint32_t{unitToByte(shared::srgbFromLinear(std::clamp(std::ldexp(emission[a], -log2), 0.0f, 1.0f)))}
               << (8 * a);
    return out == 0 ? 0 : out | static_cast<uint32_t>(log2) << 24;
}

glm::vec3 emissionOf(uint32_t light) {
    if (keepsColour(light)) return glm::vec3(0);
    const auto times = static_cast<float>(1u << (light >> 24 & 15u));
    return times * glm::vec3(linearOf(light), linearOf(light >> 8), linearOf(light >> 16));
}

uint32_t withEmission(uint32_t colour, uint32_t light) {
    const glm::vec3 more = emissionOf(light);
    if (more == glm::vec3(0)) return colour;
    uint32_t out = colour & 0xff000000u;
    for (int a = 0; a < 3; ++a)
        out |= uint32_t{unitToByte(shared::srgbFromLinear(std::min(linearOf(colour >> (8 * a)) + more[a], 1.0f)))}
               << (8 * a);
    return out;
}

uint32_t mapCode(const Patch& p) {
    const uint32_t light = p.map.light.empty() ? 0u : shared::kMapLight;
    if (p.map.density == 0) return light;
    return p.map.density | (p.map.normals.empty() ? 0u : shared::kMapNormals) |
           (p.map.hasMaterials ? shared::kMapMaterials : 0u) | light;
}

uint8_t mapCodeOf(std::span<const Patch> patches) {
    uint32_t density = 0, planes = 0;
    for (const Patch& p : patches) {
        density = std::max(density, p.map.density);
        planes |= mapCode(p) & (shared::kMapNormals | shared::kMapLight);
    }
    return static_cast<uint8_t>(density | planes);
}

MapLevel mapOf(const Patch& p) {
    MapLevel out;
    const uint32_t k = 1u << p.map.density;
    out.width = (p.width - 1) * k + 1;
    out.height = (p.height - 1) * k + 1;
    out.isKnown.assign(size_t{out.width} * out.height, 0);
    for (uint32_t j = 0; j + 1 < p.height; ++j)
        for (uint32_t i = 0; i + 1 < p.width; ++i) {
            if (!p.hasCell(i, j)) continue;
            for (uint32_t v = j * k; v <= (j + 1) * k; ++v)
                std::fill_n(out.isKnown.begin() + static_cast<std::ptrdiff_t>(out.at(i * k, v)), k + 1, uint8_t{1});
        }
    out.colours = p.map.colours;
    out.normals = p.map.normals;
    out.light = p.map.light;
    return out;
}

MapLevel coarser(const MapLevel& fine, bool hasMaterials) {
    MapLevel out;
    out.width = fine.width / 2 + 1;
    out.height = fine.height / 2 + 1;
    const size_t texels = size_t{out.width} * out.height;
    out.isKnown.assign(texels, 0);
    if (!fine.colours.empty()) out.colours.assign(texels, 0);
    if (!fine.normals.empty()) out.normals.assign(texels, 0);
    if (!fine.light.empty()) out.light.assign(texels, 0);
    for (uint32_t j = 0; j < out.height; ++j)
        for (uint32_t i = 0; i < out.width; ++i) {
            TexelMean mean;
            for (int v = -1; v <= 1; ++v)
                for (int u = -1; u <= 1; ++u) {
                    const int64_t x = 2 * int64_t{i} + u, y = 2 * int64_t{j} + v;
                    if (x < 0 || y < 0 || x >= fine.width || y >= fine.height) continue;
                    const size_t from = fine.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
                    if (fine.isKnown[from] == 0) continue;
                    const float w = (u == 0 ? 0.5f : 0.25f) * (v == 0 ? 0.5f : 0.25f);
                    mean.weights += w;
                    if (!fine.colours.empty()) mean.add(w, fine.colours[from]);
                    if (!fine.light.empty()) mean.addLight(w, fine.light[from]);
                    if (!fine.normals.empty()) mean.normal += w * glm::vec3(shared::octDecode(fine.normals[from]));
                }
            if (!(mean.weights > 0)) continue;
            const size_t to = out.at(i, j);
            out.isKnown[to] = 1;
            if (!fine.colours.empty()) out.colours[to] = mean.texel(hasMaterials);
            if (!fine.light.empty()) out.light[to] = mean.light();
            if (!fine.normals.empty())
                out.normals[to] = octEncode(glm::length(mean.normal) > 1e-3f ? mean.normal : glm::vec3(0, 0, 1));
        }
    return out;
}

void sampleColours(Patch& p) {
    if (p.map.density == 0) return;
    MapLevel level = mapOf(p);
    level.normals.clear();
    level.light.clear();
    for (uint32_t l = 0; l < p.map.density; ++l) level = coarser(level, false);
    // (A level may be a texel wider than the samples are.)
    for (uint32_t j = 0; j < p.height; ++j)
        for (uint32_t i = 0; i < p.width; ++i) {
            const size_t s = p.at(i, j);
            if (p.heights[s] != 0) p.colours[s] = level.colours[level.at(i, j)] & 0xffffffu;
        }
}

PatchMips::PatchMips(const Patch& patch) : density_(patch.map.density), flags_(mapCode(patch)) {
    if (flags_ == 0) return;
    levels_.push_back(mapOf(patch));
    while (levels_.size() < shared::mapLevels(density_))
        levels_.push_back(coarser(levels_.back(), patch.map.hasMaterials));
}

uint32_t PatchMips::appendTo(std::vector<uint32_t>& texels, uint32_t i, uint32_t j) const {
    if (flags_ == 0) return 0;
    const size_t first = texels.size();
    STIPPLE_CHECK(first + shared::mapWords(flags_) < kMostWords, "the maps of a chunk are too large");
    texels.resize(first + shared::mapWords(flags_), 0);
    for (uint32_t l = 0; l < levels_.size(); ++l) {
        const MapLevel& level = levels_[l];
        const uint32_t x0 = (i << density_) >> l, y0 = (j << density_) >> l;
        const uint32_t across = shared::mapCellsAcross(density_, l) + 1, up = shared::mapCellsUp(density_, l) + 1;
        const uint32_t width = std::min(across, level.width - x0), height = std::min(up, level.height - y0);
        const size_t to = first + shared::mapLevelFirst(density_, l);
        const auto copy = [&](const std::vector<uint32_t>& from, size_t plane) {
            for (uint32_t y = 0; y < height; ++y)
                std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(level.at(x0, y0 + y)), width,
                            texels.begin() + static_cast<std::ptrdiff_t>(plane + size_t{y} * across));
        };
        if (!level.colours.empty()) copy(level.colours, to);
        if (!level.light.empty()) copy(level.light, to + shared::mapLightFirst(flags_));
        if (!level.normals.empty()) copy(level.normals, to + shared::mapTexels(density_));
    }
    return flags_ | static_cast<uint32_t>(first) << shared::kMapFirstShift;
}

}  // namespace stipple::lod
