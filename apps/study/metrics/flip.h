// LDR-FLIP: how much of a difference a viewer sees who alternates between two pictures. Written by the formulas of
// Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astroem & Fairchild 2020, "FLIP: A Difference Evaluator for
// Alternating Images" (sections 4.1 to 4.3): colours filtered by the eye's contrast sensitivity, HyAB distance with the
// Hunt effect, sharpened where edges or points differ.
#pragma once

#include "apps/study/metrics/filter.h"
#include "engine/base/result.h"
#include "engine/render/backend.h"

namespace stipple::study {

/// The paper's viewer: 0.7 m before a 0.7 m wide display of 3,840 pixels.
inline constexpr double kPixelsPerDegree = 67;

/// Of each pixel, 0 (nobody sees a difference) to 1. Error: sizes differ.
Result<Plane> flip(const render::Image& image, const render::Image& reference,
                   double pixelsPerDegree = kPixelsPerDegree);

}  // namespace stipple::study
