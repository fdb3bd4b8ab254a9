#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/reference/reference.h"

namespace stipple::reference {

Result<ImageDifference> compareImages(const render::Image& a, const render::Image& b, int threshold,
                                      render::Image* difference) {
    if (a.width != b.width || a.height != b.height)
        return fail(ErrorKind::input, fmt::format("the images have different sizes: {} x {} and {} x {}", a.width,
                                                  a.height, b.width, b.height));
    ImageDifference out;
    const size_t pixels = size_t{a.width} * a.height;
    if (difference) {
        difference->width = a.width;
        difference->height = a.height;
        difference->rgba.resize(pixels);
    }
    double sum = 0, foregroundSum = 0;
    uint64_t foreground = 0, differing = 0, both = 0, either = 0;
    for (size_t i = 0; i < pixels; ++i) {
        const uint32_t ca = a.rgba[i], cb = b.rgba[i];
        const bool inA = ca >> 24 >= 128, inB = cb >> 24 >= 128;
        both += inA && inB;
        out.hasCoverage = out.hasCoverage || ((ca & cb) >> 24) != 255;
        either += inA || inB;
        int worst = 0;
        double squares = 0;
        uint32_t shown = 0xff000000u;
        for (unsigned c = 0; c < 24; c += 8) {
            // Coverage counts: a pixel that is background in one image differs by what is in front of it in the other.
            const int d = std::abs(static_cast<int>(ca >> c & 255u) - static_cast<int>(cb >> c & 255u));
            worst = std::max(worst, d);
            squares += double(d) * d;
            shown |= static_cast<uint32_t>(std::min(255, d * 8)) << c;
        }
        out.maxDiff = std::max(out.maxDiff, worst);
        differing += worst > threshold;
        sum += squares;
        if ((ca | cb) >> 24 != 0) {
            foregroundSum += squares;
            ++foreground;
        }
        if (difference) difference->rgba[i] = shown;
    }
    const auto psnr = [](double squares, uint64_t count) {
        if (count == 0 || squares == 0) return std::numeric_limits<double>::infinity();
        return 10 * std::log10(255.0 * 255.0 * 3 * static_cast<double>(count) / squares);
    };
    out.psnr = psnr(sum, pixels);
    out.foregroundPsnr = psnr(foregroundSum, foreground);
    out.differingFraction = pixels ? static_cast<double>(differing) / static_cast<double>(pixels) : 0;
    out.silhouetteIou = either ? static_cast<double>(both) / static_cast<double>(either) : 1;
    for (uint32_t y = 2; y + 2 < a.height; ++y)
        for (uint32_t x = 2; x + 2 < a.width; ++x) {
            if (a.rgba[size_t{y} * a.width + x] >> 24 != 0) continue;
            bool inside = true;
            for (uint32_t dy = 0; dy < 5 && inside; ++dy)
                for (uint32_t dx = 0; dx < 5; ++dx)
                    inside = inside && b.rgba[size_t{y + dy - 2} * a.width + x + dx - 2] >> 24 == 255;
            out.holes += inside;
        }
    return out;
}

}  // namespace stipple::reference
