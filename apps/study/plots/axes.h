// Where values lie on an axis, and where its ticks stand.
#pragma once

#include <string>
#include <vector>

namespace stipple::study {

struct Axis {
    double low = 0, high = 1;  ///< values at its ends; low < high
    bool isLog = false;
    double from = 0, to = 1;  ///< where they are drawn
    double at(double value) const;
    std::vector<double> ticks() const;
};

/// Holds all values with a little room; those that cannot be shown (not finite; on a logarithmic axis: not above 0) are
/// left out. Without any: 0 to 1 (1 to 10).
Axis axisOf(const std::vector<double>& values, bool isLog, double from, double to);
bool isShown(double value, bool isLog);
/// "0.5", "20", "1e-05".
std::string tickText(double value);

}  // namespace stipple::study
