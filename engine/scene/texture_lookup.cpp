#include "engine/scene/texture_lookup.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/numbers.h"
#include "shaders/shared/pack.h"

namespace stipple::scene {
namespace {

constexpr int kMostTaps = 8;  ///< along each axis

float linearOf(uint32_t byte) {
    static const std::array<float, 256> table = [] {
        std::array<float, 256> t{};
        for (uint32_t i = 0; i < 256; ++i) t.at(i) = shared::linearFromSrgb(static_cast<float>(i) / 255.0f);
        return t;
    }();
    return table.at(byte);
}

/// Far enough from the ends that neighbours are whole numbers, too.
int64_t texelOf(float x) { return toWhole<int64_t>(std::clamp(std::floor(x), -9e15f, 9e15f)); }

int64_t wrapped(int64_t i, int64_t size, Wrap wrap) {
    if (wrap == Wrap::clamp) return std::clamp<int64_t>(i, 0, size - 1);
    const int64_t period = wrap == Wrap::mirror ? 2 * size : size;
    const int64_t m = (i % period + period) % period;
    return m < size ? m : period - 1 - m;
}

}  // namespace

glm::vec4 lookup(const DecodedImage& image, const Texture& texture, glm::vec2 uv, float footprint, bool isColour) {
    if (image.rgba.empty() || !std::isfinite(uv.x + uv.y)) return glm::vec4(1);
    const int taps = std::clamp(toWhole<int>(std::ceil(footprint)), 1, kMostTaps);
    const auto w = static_cast<int64_t>(image.width), h = static_cast<int64_t>(image.height);
    glm::vec4 sum(0);
    for (int ty = 0; ty < taps; ++ty)
        for (int tx = 0; tx < taps; ++tx) {
            const float dx = ((static_cast<float>(tx) + 0.5f) / static_cast<float>(taps) - 0.5f) * footprint;
            const float dy = ((static_cast<float>(ty) + 0.5f) / static_cast<float>(taps) - 0.5f) * footprint;
            const float x = uv.x * static_cast<float>(w) + dx - 0.5f, y = uv.y * static_cast<float>(h) + dy - 0.5f;
            const float fx = x - std::floor(x), fy = y - std::floor(y);
            for (int k = 0; k < 4; ++k) {
                const int64_t px = wrapped(texelOf(x) + (k & 1), w, texture.wrapU);
                const int64_t py = wrapped(texelOf(y) + (k >> 1), h, texture.wrapV);
                const uint32_t c = image.rgba[static_cast<size_t>(py * w + px)];
                const float weight = ((k & 1) != 0 ? fx : 1 - fx) * (k > 1 ? fy : 1 - fy);
                const auto channel = [&](uint32_t byte) {
                    return isColour ? linearOf(byte) : static_cast<float>(byte) / 255.0f;
                };
                sum += weight * glm::vec4(channel(c & 255u), channel(c >> 8 & 255u), channel(c >> 16 & 255u),
                                          static_cast<float>(c >> 24) / 255.0f);
            }
        }
    return sum / static_cast<float>(taps * taps);
}

}  // namespace stipple::scene
