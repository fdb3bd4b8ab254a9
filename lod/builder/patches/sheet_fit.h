// A height over a plane fitted to a few points, whose weights hang on where it comes to lie: quadratic, else linear.
// Four points at once; the sums of lanes are added in one order, so that all instruction sets give the same values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "lod/builder/patches/near_points.h"

namespace stipple::lod {

/// Places in units of h: along U, V and N, about the place that was asked about.
struct FitPoints {
    static constexpr size_t kRoom = NearPoints::kMost;
    static_assert(kRoom % 4 == 0);
    alignas(32) double x[kRoom], y[kRoom], z[kRoom];  // NOLINT: set as far as they are read
    alignas(32) double squared[kRoom];                // NOLINT: x^2 + y^2
    alignas(32) double weight[kRoom];                 // NOLINT: of the last fit
    uint32_t index[kRoom];                            // NOLINT: points
    size_t n = 0;
};

using FitTerms = std::array<double, 6>;  ///< of 1, x, y, x^2, x y, y^2

struct SheetFit {
    FitTerms terms{};
    double height = 0;  ///< terms[0]
    double loose = 0;   ///< weighted root mean square of the residuals
};

/// With weights exp(-(x^2 + y^2 + (z - height)^2)), times whatever makes that of the nearest about 1. `isQuadratic`
/// where the points ask for no less; false where they say too little, or the height does not come to rest within 1.
bool fitSheet(FitPoints& points, bool isQuadratic, SheetFit& fit);

}  // namespace stipple::lod
