// A place of a texture, prefiltered: for what is made of textured triangles before there are tiles of mips.
#pragma once

#include "engine/scene/scene.h"

namespace stipple::scene {

/// 8-bit RGBA, sRGB.
struct DecodedImage {
    uint32_t width = 0, height = 0;
    std::vector<uint32_t> rgba;
};

/// Linear colour and alpha at uv; bilinear, averaged over `footprint` texels each way (at most 8 x 8 of them are looked
/// at). `isColour`: else texels are numbers. White where there is no image.
glm::vec4 lookup(const DecodedImage& image, const Texture& texture, glm::vec2 uv, float footprint,
                 bool isColour = true);

}  // namespace stipple::scene
