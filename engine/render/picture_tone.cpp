#include "engine/render/picture_tone.h"

#include <algorithm>
#include <cmath>

#include "shaders/shared/record.h"
#include "shaders/shared/tone.h"

namespace stipple::render {
namespace {

bool isTone(const EffectRequest& request) { return request.name == "tone"; }

/// Of a pixel that is covered by `share`: what the surface sends. (Shares are kept in 8 bits: before what is much
/// brighter the rest may come out below nothing.)
float ownLight(const Image& image, size_t pixel, size_t channel, const glm::vec3& behind, float share) {
    const float all = image.linear[3 * pixel + channel];
    return std::max(all - (1 - share) * behind[static_cast<int>(channel)], 0.0f) / share;
}

/// Is it more than the rounding of its share makes of what is behind?
bool isTold(double luminance, const glm::vec3& behind, float share) {
    return luminance * share >= 0.5 / 255 * (0.2126 * behind.x + 0.7152 * behind.y + 0.0722 * behind.z);
}

float coverOf(const Image& image, size_t pixel) { return static_cast<float>(image.rgba[pixel] >> 24) / 255.0f; }

}  // namespace

bool isMetered(const DrawSettings& settings) {
    return settings.parameters.tone.metering != 0 && settings.debugView == shared::kDebugNone &&
           std::any_of(settings.effects.begin(), settings.effects.end(), isTone);
}

bool takeTone(DrawSettings& settings) {
    const ToneSettings& tone = settings.parameters.tone;
    return std::erase_if(settings.effects, isTone) > 0 &&
           (tone.exposure != 1 || tone.curve != 0 || tone.metering != 0) && settings.debugView == shared::kDebugNone;
}

double meteredExposure(const Image& image, const Behind& behind) {
    constexpr double kGrey = 0.18, kLeast = 0x1p-20;
    double logarithms = 0, weights = 0;
    for (size_t i = 0; i < image.rgba.size(); ++i) {
        const float share = coverOf(image, i);
        if (!(share > 0)) continue;
        const glm::vec3 beyond = share < 1 ? behind.at(i) : glm::vec3(0);
        const auto light = [&](size_t c) { return double{ownLight(image, i, c, beyond, share)}; };
        const double luminance = 0.2126 * light(0) + 0.7152 * light(1) + 0.0722 * light(2);
        if (share < 1 && !isTold(luminance, beyond, share)) continue;
        logarithms += double{share} * std::log2(std::clamp(luminance, kLeast, 1 / kLeast));
        weights += double{share};
    }
    return weights > 0 ? std::clamp(kGrey / std::exp2(logarithms / weights), kLeast, 1 / kLeast) : 1;
}

void toneImage(const DrawSettings& settings, const lod::View& view, Image& image, Executor& executor) {
    const ToneSettings& asked = settings.parameters.tone;
    const Behind behind(settings, view);
    const double metered = asked.metering != 0 ? meteredExposure(image, behind) : 1;
    const shared::ToneConstants tone{static_cast<float>(asked.exposure * metered), asked.curve != 0 ? 1u : 0u};
    const auto tonePixel = [&](size_t i) {
        const float share = coverOf(image, i);
        if (!(share > 0) && !behind.isBackdrop()) return;
        const glm::vec3 beyond = share < 1 ? behind.at(i) : glm::vec3(0);
        uint32_t bytes = image.rgba[i] & 0xff000000u;
        for (size_t c = 0; c < 3; ++c) {
            const float of = beyond[static_cast<int>(c)];
            const float shown = (1 - share) * (behind.isBackdrop() ? shared::toned(tone, of) : of);
            float& light = image.linear[3 * i + c];
            light = shown + (share > 0 ? share * shared::toned(tone, ownLight(image, i, c, beyond, share)) : 0);
            bytes |= static_cast<uint32_t>(shared::srgbFromLinear(std::clamp(light, 0.0f, 1.0f)) * 255.0f + 0.5f)
                     << (8 * c);
        }
        image.rgba[i] = bytes;
    };
    executor.parallelFor(image.rgba.size(), size_t{1} << 14, [&](size_t first, size_t end) {
        for (size_t i = first; i < end; ++i) tonePixel(i);
    });
}

}  // namespace stipple::render
