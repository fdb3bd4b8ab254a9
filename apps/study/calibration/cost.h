// What a frame takes: ms = a + b pixels + c records + d triangles, of one mode on one device, each at least 0
// (ALGORITHMS 2.4). Fitted to frames by least squares of relative errors; how far off those frames are is part of it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stipple::study {

/// What a frame has to do.
struct Load {
    double pixels = 0, records = 0, triangles = 0;
};
/// A frame of a calibration.
struct CostSample {
    std::string mode;
    uint32_t width = 0, height = 0;
    double errorPixels = 0;  ///< asked for
    double records = 0, triangles = 0;
    double ms = 0;  ///< median of its repetitions
    Load load() const { return {double(width) * height, records, triangles}; }
};

struct CostModel {
    double perFrame = 0, perPixel = 0, perRecord = 0, perTriangle = 0;  ///< ms
    double low = 1, high = 1;  ///< times of nine in ten of the frames, over what is said of them
    double msOf(const Load& load) const {
        return perFrame + perPixel * load.pixels + perRecord * load.records + perTriangle * load.triangles;
    }
};

/// No samples: all 0.
CostModel fitCost(std::span<const CostSample> samples);

}  // namespace stipple::study
