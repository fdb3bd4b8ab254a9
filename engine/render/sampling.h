// Where the frames of a picture that is their mean look: in the pixel, on the lens, in the time of the exposure; and
// which share of the allowed error each has, so that levels of detail fade.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>

#include "lod/cut/cut.h"

namespace stipple::render {

/// Of one frame: the same for all pixels, so that a frame stays a frame.
struct FrameSample {
    glm::dvec2 pixel{0};  ///< from the pixel's middle, px: in (-1/2, 1/2)
    glm::dvec2 lens{0};   ///< in the unit disc
    double time = 0;      ///< from the middle of the exposure, share of it: in (-1/2, 1/2)
    double fade = 0;      ///< how far down the band of allowed errors: in (0, 1)
};

/// Number `index` of Sobol's sequence in six dimensions (direction numbers: Joe & Kuo 2008), each scrambled after Owen
/// 1995: in (0, 1). The first 2^k of it, and every next 2^k, have one in each interval of 2^-k of any dimension, and
/// of the first two one in each box of area 2^-k whose sides are powers of two.
std::array<double, 6> lowDiscrepancy(uint32_t index);

/// Pixels and exposures are covered evenly, and so is the lens (by area: Shirley & Chiu 1997).
FrameSample sampleOf(uint32_t index);

/// A thin lens; world units. Without an aperture: a pinhole.
struct Lens {
    double aperture = 0;  ///< its diameter
    double focus = 1;     ///< depth of the plane that is sharp
    bool isPinhole() const { return !(aperture > 0); }
};
/// Diameter of the disc, px, that a small bright thing at `depth` becomes: F A |1/focus - 1/depth|.
double circleOfConfusion(const lod::View& view, const Lens& lens, double depth);

/// What one frame sees: through another place of the pixel, and with the eye at another place of the lens, from where
/// the plane in focus is seen at the same pixels. Lenses are of perspective views.
lod::View viewOf(const lod::View& view, const FrameSample& sample, const Lens& lens);

}  // namespace stipple::render
