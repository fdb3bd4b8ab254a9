// What the passes of a layer read: its constants, the picture behind it with its means, its back.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "engine/render/draw_list.h"
#include "engine/render/layers.h"
#include "shaders/shared/record.h"

namespace stipple::render {
namespace {

shared::Optic toShader(const WorldOptic& o) {
    shared::Optic s{};
    s.transmission = static_cast<float>(o.transmission);
    s.ior = static_cast<float>(o.ior);
    s.thickness = static_cast<float>(o.thickness);
    s.absorption = glm::vec3(o.absorption);
    s.straightOn = glm::vec3(o.straightOn);
    s.most = static_cast<float>(o.most);
    return s;
}

/// Pieces of pixels of their own.
template <typename Body>
void overPixels(Executor* executor, size_t pixels, const Body& body) {
    constexpr size_t kGrain = 1 << 14;
    if (executor != nullptr)
        executor->parallelFor(pixels, kGrain, body);
    else
        body(0, pixels);
}

/// Linear light times coverage, and coverage; then means of two by two, each of what of them lies in the picture.
void fillBehind(const Image& image, Executor* executor, LayerTables& t) {
    shared::LayerConstants& c = t.constants;
    const size_t pixels = size_t{image.width} * image.height;
    size_t floats = 0;
    c.behindLevels = 0;
    for (uint32_t l = 0, w = image.width, h = image.height; l < shared::kBehindLevels; ++l) {
        c.behindFirst[l] = static_cast<uint32_t>(floats);
        ++c.behindLevels;
        floats += size_t{4} * w * h;
        if (w == 1 && h == 1) break;
        w = (w + 1) / 2;
        h = (h + 1) / 2;
    }
    c.behindDepths = static_cast<uint32_t>(floats);
    t.behind.resize(floats + pixels);
    float* const level0 = t.behind.data();
    std::atomic<float> most{c.farthest};
    overPixels(executor, pixels, [&](size_t first, size_t end) {
        float farthest = 0;
        for (size_t i = first; i < end; ++i) {
            // Where a pixel is covered in part the picture's colour has its background in it: that counts as behind,
            // too.
            const float cover = image.depth[i] > 0 ? 1.0f : 0.0f;
            for (size_t k = 0; k < 3; ++k) level0[4 * i + k] = cover * image.linear[3 * i + k];
            level0[4 * i + 3] = cover;
            farthest = std::max(farthest, image.depth[i]);
            t.behind[c.behindDepths + i] = image.depth[i];
        }
        for (float other = most; farthest > other && !most.compare_exchange_weak(other, farthest);) {
        }
    });
    c.farthest = most;
    uint32_t w = image.width, h = image.height;
    for (uint32_t l = 1; l < c.behindLevels; ++l) {
        const float* const from = t.behind.data() + c.behindFirst[l - 1];
        float* const to = t.behind.data() + c.behindFirst[l];
        const uint32_t halfW = (w + 1) / 2, halfH = (h + 1) / 2;
        overPixels(executor, size_t{halfW} * halfH, [&](size_t first, size_t end) {
            for (size_t i = first; i < end; ++i) {
                const auto x = static_cast<uint32_t>(i % halfW), y = static_cast<uint32_t>(i / halfW);
                const uint32_t x1 = std::min(2 * x + 1, w - 1), y1 = std::min(2 * y + 1, h - 1);
                const std::array<size_t, 4> at{size_t{2} * y * w + 2 * x, size_t{2} * y * w + x1,
                                               size_t{y1} * w + 2 * x, size_t{y1} * w + x1};
                for (size_t k = 0; k < 4; ++k)
                    to[4 * i + k] = 0.25f * (from[4 * at[0] + k] + from[4 * at[1] + k] +
                                             (from[4 * at[2] + k] + from[4 * at[3] + k]));
            }
        });
        w = halfW;
        h = halfH;
    }
}

void fillBack(const LayerInput& layer, const glm::dmat3& cameraFromWorld, const glm::dvec3& eye, LayerTables& t) {
    shared::LayerConstants& c = t.constants;
    const Image& image = *layer.back;
    const lod::View& v = layer.backView;
    c.backEdge = image.width;
    c.backX = glm::vec3(cameraFromWorld * v.right);
    c.backY = glm::vec3(cameraFromWorld * v.down);
    c.backZ = glm::vec3(cameraFromWorld * v.forward);
    c.backEye = glm::vec3(cameraFromWorld * (v.eye - eye));
    c.backFocal = static_cast<float>(v.focalPixels);
    const size_t texels = size_t{image.width} * image.height;
    t.back.resize(4 * texels);
    overPixels(layer.executor, texels, [&](size_t first, size_t end) {
        for (size_t i = first; i < end; ++i) {
            const glm::dvec3 n =
                cameraFromWorld * glm::dvec3(image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2]);
            t.back[4 * i] = image.depth[i];
            for (int k = 0; k < 3; ++k) t.back[4 * i + 1 + static_cast<size_t>(k)] = static_cast<float>(n[k]);
        }
    });
}

}  // namespace

void fillLayer(const LayerInput& layer, const DrawList& out, LayerTables& t) {
    const lod::View& view = out.view;
    const glm::dmat3 cameraFromWorld = glm::transpose(glm::dmat3(view.right, view.down, view.forward));
    t.constants = {};
    t.optics.clear();
    t.behind.clear();
    t.back.clear();
    for (const WorldOptic& o : layer.optics) t.optics.push_back(toShader(o));
    shared::LayerConstants& c = t.constants;
    c.way = layer.way;
    c.pointOptic = layer.pointOptic;
    c.plainRoughness = static_cast<float>(layer.plainRoughness);
    c.bodyCentre = glm::vec3(cameraFromWorld * (layer.bodyCentre - view.eye));
    c.bodyRadius = static_cast<float>(layer.bodyRadius);
    c.advanced = static_cast<float>(out.eyeAdvanced);
    if (layer.behind != nullptr) fillBehind(*layer.behind, layer.executor, t);
    c.farthest -= c.farthest > 0 ? c.advanced : 0.0f;
    if (layer.back != nullptr) fillBack(layer, cameraFromWorld, view.eye, t);
}

namespace {

/// Of the pixels from `first` to `end`.
void putPixels(const Image& layer, const glm::vec3& background, float opacity, size_t first, size_t end,
               Image& behind) {
    const auto byteOf = [](float linear) {
        const float l = linear > 0 ? std::min(linear, 1.0f) : 0.0f;
        return static_cast<uint32_t>(shared::srgbFromLinear(l) * 255.0f + 0.5f);
    };
    for (size_t i = first; i < end; ++i) {
        const float depth = layer.depth[i];
        if (!(depth > 0) || (behind.depth[i] > 0 && behind.depth[i] <= depth)) continue;
        const float covered = static_cast<float>(layer.rgba[i] >> 24), alpha = opacity * covered;
        const float left = 1 - alpha / 255;
        const bool isShown = alpha >= 127.5f;
        for (size_t k = 0; k < 3; ++k) {
            // The layer's colour has its share of the background in it.
            const float own = layer.linear[3 * i + k] - (1 - covered / 255) * background[static_cast<int>(k)];
            float& c = behind.linear[3 * i + k];
            c = opacity * own + left * c;
            if (isShown) behind.normal[3 * i + k] = layer.normal[3 * i + k];
        }
        if (isShown) behind.depth[i] = depth;
        const float under = static_cast<float>(behind.rgba[i] >> 24);
        const auto cover = static_cast<uint32_t>(alpha + left * under + 0.5f);
        behind.rgba[i] = alpha == 255 ? layer.rgba[i]
                                      : byteOf(behind.linear[3 * i]) | byteOf(behind.linear[3 * i + 1]) << 8 |
                                            byteOf(behind.linear[3 * i + 2]) << 16 | cover << 24;
    }
}

}  // namespace

void putLayer(const Image& layer, const glm::vec3& background, float opacity, Image& behind, Executor& executor) {
    overPixels(&executor, behind.rgba.size(),
               [&](size_t first, size_t end) { putPixels(layer, background, opacity, first, end, behind); });
}

}  // namespace stipple::render
