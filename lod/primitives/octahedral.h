// Encoding of the octahedral normal of shaders/shared/record.h, to the nearest code of each coordinate.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "engine/base/numbers.h"
#include "shaders/shared/record.h"

namespace stipple::lod {

/// `n`: any finite length but zero.
inline uint32_t octEncode(glm::vec3 n) {
    const float largest = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
    if (!(largest > 1e-30f && largest < 1e30f)) n = withoutScale(n);  // their sum would be rounded, or none
    const float sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    float x = n.x / sum, y = n.y / sum;
    if (n.z < 0) {
        const float fx = (1.0f - std::abs(y)) * (x >= 0 ? 1.0f : -1.0f);
        y = (1.0f - std::abs(x)) * (y >= 0 ? 1.0f : -1.0f);
        x = fx;
    }
    const auto code = [](float v) {
        return toWhole<uint32_t>(std::clamp(std::floor((v + 1.0f) * 32767.0f + 0.5f), 0.0f, 65534.0f));
    };
    return code(x) | code(y) << 16;
}

/// The same with fewer of the 16 bits of each coordinate (32: five less, at most 0.12 degrees off), which are that much
/// less to store. The axes stay exact.
template <int kStep = 32>
uint32_t roundedNormal(glm::vec3 n) {
    constexpr int kMiddle = 32767;
    const uint32_t exact = octEncode(n);
    const auto code = [](uint32_t c) {
        const int off = static_cast<int>(c) - kMiddle;
        const int steps = (off + (off < 0 ? -kStep / 2 : kStep / 2)) / kStep;
        return static_cast<uint32_t>(std::clamp(kMiddle + kStep * steps, 0, 2 * kMiddle));
    };
    return code(exact & 0xffffu) | code(exact >> 16) << 16;
}

}  // namespace stipple::lod
