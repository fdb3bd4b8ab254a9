// The frames that a device was calibrated with, and what is chosen by them.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/study/calibration/cost.h"
#include "engine/base/result.h"

namespace stipple::study {

/// Of one scene on one device.
struct Curve {
    std::string scene, device, processor, date, version;
    int threads = 0;
    std::vector<CostSample> samples;
    std::vector<CostSample> of(const std::string& mode) const;
};
nlohmann::json jsonOfCurve(const Curve& curve);
/// Error (input): it is no curve.
Result<Curve> curveOf(const std::string& text, const std::string& path);

/// What a view has to do at an error asked for, px.
using LoadAt = std::function<Load(double errorPixels)>;

/// Errors that are chosen from: an eighth of an octave apart.
inline constexpr double kFinestPixels = 0.125, kCoarsestPixels = 64;

/// The smallest error, px, whose frame takes no longer than `ms`; none: even the coarsest takes longer.
std::optional<double> errorWithin(const CostModel& model, const LoadAt& load, double ms);

}  // namespace stipple::study
