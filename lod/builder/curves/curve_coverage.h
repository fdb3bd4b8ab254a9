// How much of the view curves and samples of them cover.
#pragma once

#include <vector>

#include "engine/base/executor.h"
#include "lod/builder/curves/curve_samples.h"

namespace stipple::lod {

/// Leaves lie close together and hide each other; discs that are larger than they reach out between them and cover
/// more, though their area is the same. By what their radius is to be multiplied so that they cover as much as the
/// curves do, averaged over a few directions: of all samples, of the first half of them, of a quarter, ... as long as
/// there are more than a few dozen.
std::vector<float> coverageFactors(const CurveSet& curves, const CurveSamples& samples, Executor& executor);

}  // namespace stipple::lod
