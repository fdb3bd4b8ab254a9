// Pictures side by side, as figures have them.
#pragma once

#include <vector>

#include "engine/render/backend.h"

namespace stipple::study {

/// Part of a picture, each pixel `zoom` times as large.
render::Image cropped(const render::Image& image, uint32_t x, uint32_t y, uint32_t width, uint32_t height,
                      uint32_t zoom);
/// From left to right, opaque, with a gap of a few pixels; all of one height.
render::Image sideBySide(const std::vector<render::Image>& images);
/// One below the other; all of one width.
render::Image stacked(const std::vector<render::Image>& images);

}  // namespace stipple::study
