// Structural similarity (Wang, Bovik, Sheikh & Simoncelli 2004, section III B): luma, Gaussian windows of 11 x 11 with
// sigma 1.5, K1 = 0.01, K2 = 0.03.
#pragma once

#include "engine/base/result.h"
#include "engine/render/backend.h"

namespace stipple::study {

/// Mean over all windows that lie inside the picture (of smaller pictures: all pixels); 1: the same. Error: sizes
/// differ.
Result<double> ssim(const render::Image& image, const render::Image& reference);

}  // namespace stipple::study
