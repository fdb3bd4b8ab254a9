#include "engine/image/coverage.h"

#include <algorithm>
#include <cmath>

#include "engine/image/image_io.h"
#include "engine/render/draw_list.h"

namespace stipple::image {

void makeOpaque(render::Image& image) {
    for (uint32_t& pixel : image.rgba) pixel |= 0xff000000u;
}

void separateCoverage(render::Image& image) {
    const bool hasLinear = image.linear.size() == 3 * image.rgba.size();
    for (size_t i = 0; i < image.rgba.size(); ++i) {
        uint32_t& pixel = image.rgba[i];
        const uint32_t alpha = pixel >> 24;
        if (alpha == 0) pixel = 0;
        if (alpha == 0 || alpha == 255) continue;
        uint32_t rgb = 0;
        for (uint32_t c = 0; c < 3; ++c) {
            const float drawn = hasLinear
                                    ? image.linear[3 * i + c]
                                    : shared::linearFromSrgb(static_cast<float>(pixel >> (8 * c) & 255u) / 255.0f);
            const float own = std::clamp(drawn * 255.0f / static_cast<float>(alpha), 0.0f, 1.0f);
            rgb |= static_cast<uint32_t>(shared::srgbFromLinear(own) * 255.0f + 0.5f) << (8 * c);
        }
        pixel = alpha << 24 | rgb;
    }
}

Result<void> writePicture(const std::string& path, render::Image& image, const PictureFormat& format) {
    if (format.hasAlpha)
        separateCoverage(image);
    else
        makeOpaque(image);
    return writeImage(path, image, format.transfer);
}

}  // namespace stipple::image
