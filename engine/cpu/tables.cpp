#include <cmath>

#include "engine/cpu/kernels.h"
#include "shaders/shared/pack.h"

namespace stipple::cpu {

Tables makeTables() {
    Tables t{};
    for (uint32_t i = 0; i < 256; ++i) {
        t.radiusFraction.at(i) = shared::radiusFraction(i);
        const float root = std::sqrt(shared::linearFromSrgb(static_cast<float>(i) / 255.0f));
        t.red.at(i) = static_cast<uint32_t>(root * 2047.0f + 0.5f);
        t.green.at(i) = t.red.at(i) << 11;
        t.blue.at(i) = static_cast<uint32_t>(root * 1023.0f + 0.5f) << 22;
    }
    for (uint32_t i = 0; i < 2048; ++i) {
        const float root = static_cast<float>(i) / 2047.0f;
        t.srgbByte.at(i) = static_cast<uint32_t>(shared::srgbFromLinear(root * root) * 255.0f + 0.5f);
    }
    // As packed colours are unpacked and written (outputRow).
    const auto shown = [&](float root) { return t.srgbByte.at(static_cast<uint32_t>(root * 2047.0f + 0.5f)); };
    for (uint32_t i = 0; i < 256; ++i) {
        t.shownRed.at(i) = shown(std::sqrt(shared::unpackRed(t.red.at(i)))) | 0xff000000u;
        t.shownGreen.at(i) = shown(std::sqrt(shared::unpackGreen(t.green.at(i)))) << 8;
        t.shownBlue.at(i) = shown(std::sqrt(shared::unpackBlue(t.blue.at(i)))) << 16;
    }
    return t;
}

}  // namespace stipple::cpu
