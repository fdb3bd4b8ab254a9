// Pictures.
#pragma once

#include <stipple/result.h>

#include <cstdint>
#include <string>
#include <vector>

namespace stipple::v1 {

struct Image {
    uint32_t width = 0, height = 0;
    /// Rows from the top, 4 bytes a pixel: red, green, blue (sRGB, over the background), coverage.
    std::vector<uint8_t> rgba;
    std::vector<float> depth;   ///< along the view axis, world units; 0: background. Only if asked for.
    std::vector<float> normal;  ///< x y z a pixel, world space, towards the eye. Only if asked for.
    std::vector<float> linear;  ///< r g b a pixel, linear light, background included. Only if asked for.
};

/// .png (opaque), or .exr with linear colours, depth and normals, where the image has them. Whole or not at all.
STIPPLE_API Result<void> writeImage(const std::string& path, const Image& image);

}  // namespace stipple::v1
