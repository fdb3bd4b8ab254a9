// What the alpha channel of a picture says: nothing (opaque, background included), or how much of a pixel is covered.
#pragma once

#include <string>

#include "engine/base/result.h"
#include "engine/image/transfer.h"
#include "engine/render/backend.h"

namespace stipple::image {

/// A picture with its background: alpha 255 everywhere.
void makeOpaque(render::Image& image);
/// Of a picture that was drawn on black: 8-bit colours are divided by the coverage, as PNG wants them; `linear` stays
/// multiplied with it, as EXR wants it.
void separateCoverage(render::Image& image);

struct PictureFormat {
    bool hasAlpha = false;  ///< with its coverage; the picture must have been drawn on black. Otherwise: opaque
    Transfer transfer = Transfer::srgb;  ///< of PNG; EXR has light itself
};
/// Writes a picture, whose colours are separated from its coverage, or which gets its background, on the way.
Result<void> writePicture(const std::string& path, render::Image& image, const PictureFormat& format);

}  // namespace stipple::image
