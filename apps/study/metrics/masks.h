// Silhouettes, depth and normals of two pictures.
#pragma once

#include "engine/render/backend.h"

namespace stipple::study {

struct MaskErrors {
    double overlap = 1;  ///< IoU of the pixels with a coverage of a half and more
    double boundaryPixels =
        0;               ///< mean distance of boundary pixels from the other picture's, both ways; nan: one has none
    uint64_t holes = 0;  ///< empty here, and all 5 x 5 around are covered in the reference
    uint64_t spill = 0;  ///< covered here, and all 5 x 5 around are empty in the reference
    // Where both have depth; nan where they nowhere have.
    double depthRmse = 0, depthP99 = 0;    ///< relative to the reference's depth
    double normalMean = 0, normalP95 = 0;  ///< degrees
};
/// Both of one size, with depth and normals.
MaskErrors compareMasks(const render::Image& image, const render::Image& reference);

}  // namespace stipple::study
