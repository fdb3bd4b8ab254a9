#include "apps/study/pictures.h"

#include <algorithm>

#include "engine/base/check.h"

namespace stipple::study {
namespace {

constexpr uint32_t kGap = 4, kGapColour = 0xffffffffu;

void paste(const render::Image& from, uint32_t x0, uint32_t y0, render::Image& to) {
    for (uint32_t y = 0; y < from.height; ++y)
        for (uint32_t x = 0; x < from.width; ++x)
            to.rgba[size_t{y0 + y} * to.width + x0 + x] = from.rgba[size_t{y} * from.width + x] | 0xff000000u;
}

render::Image blank(uint32_t width, uint32_t height) {
    render::Image out;
    out.width = width;
    out.height = height;
    out.rgba.assign(size_t{width} * height, kGapColour);
    return out;
}

/// One after the other along x (1, 0) or y (0, 1), with a gap between them.
render::Image joined(const std::vector<render::Image>& images, uint32_t alongX, uint32_t alongY) {
    uint32_t width = 0, height = 0;
    for (const render::Image& i : images) {
        width = std::max(width, alongX * (width + (width > 0 ? kGap : 0)) + i.width);
        height = std::max(height, alongY * (height + (height > 0 ? kGap : 0)) + i.height);
    }
    render::Image out = blank(width, height);
    uint32_t x = 0, y = 0;
    for (const render::Image& i : images) {
        paste(i, x, y, out);
        x += alongX * (i.width + kGap);
        y += alongY * (i.height + kGap);
    }
    return out;
}

}  // namespace

render::Image cropped(const render::Image& image, uint32_t x, uint32_t y, uint32_t width, uint32_t height,
                      uint32_t zoom) {
    STIPPLE_CHECK(x + width <= image.width && y + height <= image.height, "a part beyond the picture");
    render::Image out = blank(width * zoom, height * zoom);
    for (uint32_t j = 0; j < out.height; ++j)
        for (uint32_t i = 0; i < out.width; ++i)
            out.rgba[size_t{j} * out.width + i] = image.rgba[size_t{y + j / zoom} * image.width + x + i / zoom];
    return out;
}

render::Image sideBySide(const std::vector<render::Image>& images) { return joined(images, 1, 0); }

render::Image stacked(const std::vector<render::Image>& images) { return joined(images, 0, 1); }

}  // namespace stipple::study
