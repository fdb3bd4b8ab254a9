#include "apps/study/plots/axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace stipple::study {

double Axis::at(double value) const {
    const auto place = [&](double v) { return isLog ? std::log10(v) : v; };
    return from + (to - from) * (place(value) - place(low)) / (place(high) - place(low));
}

std::vector<double> Axis::ticks() const {
    std::vector<double> out;
    if (isLog) {
        const double decades = std::log10(high / low);
        for (int e = static_cast<int>(std::floor(std::log10(low))); std::pow(10.0, e) <= high; ++e)
            for (const double m : {1.0, 2.0, 5.0}) {
                const double v = m * std::pow(10.0, e);
                if (v >= low * 0.9999 && v <= high * 1.0001 && (m == 1.0 || decades < 3)) out.push_back(v);
            }
        return out;
    }
    const double rough = (high - low) / 5, power = std::pow(10.0, std::floor(std::log10(rough)));
    const double step = power * (rough / power < 1.5 ? 1 : rough / power < 3.5 ? 2 : rough / power < 7.5 ? 5 : 10);
    for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) out.push_back(k * step);
    return out;
}

bool isShown(double value, bool isLog) { return std::isfinite(value) && (!isLog || value > 0); }

Axis axisOf(const std::vector<double>& values, bool isLog, double from, double to) {
    Axis axis{isLog ? 1.0 : 0.0, isLog ? 10.0 : 1.0, isLog, from, to};
    double low = 1e300, high = -1e300;
    for (const double v : values)
        if (isShown(v, isLog)) {
            low = std::min(low, v);
            high = std::max(high, v);
        }
    if (low > high) return axis;
    if (isLog) {
        const double room = std::max(1.08, std::pow(high / low, 0.06));
        axis.low = low / room;
        axis.high = high * room;
    } else {
        const double room = high > low ? 0.06 * (high - low) : std::max(0.5, 0.1 * std::abs(high));
        axis.low = low >= 0 && low < 0.3 * high ? 0 : low - room;
        axis.high = high + room;
    }
    return axis;
}

std::string tickText(double value) {
    if (std::abs(value) < 1e-12) return "0";
    for (const auto& [unit, letter] : {std::pair(1e9, 'G'), std::pair(1e6, 'M'), std::pair(1e3, 'k')})
        if (std::abs(value) >= std::max(unit, 1e4)) return fmt::format("{:.4g}{}", value / unit, letter);
    return fmt::format("{:.4g}", value);
}

}  // namespace stipple::study
