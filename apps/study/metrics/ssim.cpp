#include "apps/study/metrics/ssim.h"

#include <fmt/format.h>

#include <cmath>

#include "apps/study/metrics/filter.h"

namespace stipple::study {
namespace {

constexpr int kRadius = 5;
constexpr double kSigma = 1.5, kC1 = 0.01 * 255 * 0.01 * 255, kC2 = 0.03 * 255 * 0.03 * 255;

/// Rec. 601, of the coded values: what the paper's pictures are.
Plane lumaOf(const render::Image& image) {
    Plane out(image.width, image.height);
    for (size_t i = 0; i < image.rgba.size(); ++i) {
        const uint32_t c = image.rgba[i];
        out.values[i] = 0.299f * static_cast<float>(c & 255u) + 0.587f * static_cast<float>(c >> 8 & 255u) +
                        0.114f * static_cast<float>(c >> 16 & 255u);
    }
    return out;
}

Plane times(const Plane& a, const Plane& b) {
    Plane out(a.width, a.height);
    for (size_t i = 0; i < out.values.size(); ++i) out.values[i] = a.values[i] * b.values[i];
    return out;
}

}  // namespace

Result<double> ssim(const render::Image& image, const render::Image& reference) {
    if (image.width != reference.width || image.height != reference.height)
        return fail(ErrorKind::input, fmt::format("the images have different sizes: {} x {} and {} x {}", image.width,
                                                  image.height, reference.width, reference.height));
    std::vector<float> window;
    double sum = 0;
    for (int k = -kRadius; k <= kRadius; ++k) sum += std::exp(-k * k / (2 * kSigma * kSigma));
    for (int k = -kRadius; k <= kRadius; ++k)
        window.push_back(static_cast<float>(std::exp(-k * k / (2 * kSigma * kSigma)) / sum));
    const Plane a = lumaOf(image), b = lumaOf(reference);
    const Plane meanA = filtered(a, window, window), meanB = filtered(b, window, window),
                squareA = filtered(times(a, a), window, window), squareB = filtered(times(b, b), window, window),
                product = filtered(times(a, b), window, window);
    const uint32_t w = image.width, h = image.height;
    const uint32_t rim = w > 2 * kRadius && h > 2 * kRadius ? kRadius : 0;
    double total = 0;
    for (uint32_t y = rim; y + rim < h; ++y)
        for (uint32_t x = rim; x + rim < w; ++x) {
            const size_t i = size_t{y} * w + x;
            const double ma = meanA.values[i], mb = meanB.values[i];
            const double va = squareA.values[i] - ma * ma, vb = squareB.values[i] - mb * mb;
            const double both = product.values[i] - ma * mb;
            total += (2 * ma * mb + kC1) * (2 * both + kC2) / ((ma * ma + mb * mb + kC1) * (va + vb + kC2));
        }
    return total / (static_cast<double>(w - 2 * rim) * static_cast<double>(h - 2 * rim));
}

}  // namespace stipple::study
