#include "engine/base/units.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

namespace stipple {
namespace {

/// A number in front and what follows it.
struct Measure {
    double value = 0;
    std::string unit;
};
std::optional<Measure> parseMeasure(const std::string& text) {
    const char* first = text.data();
    const char* const end = first + text.size();
    if (first != end && *first == '+') ++first;
    if (first == end || !(std::isdigit(static_cast<unsigned char>(*first)) || *first == '.' || *first == '-'))
        return {};
    Measure m;
    const auto [rest, error] = std::from_chars(first, end, m.value, std::chars_format::general);
    if (error != std::errc() || !std::isfinite(m.value)) return {};
    m.unit.assign(rest, end);
    return m;
}

/// The power of `base` that "", k, M, G and T stand for (either case); 0: none of them.
double factorOf(char unit, double base) {
    static constexpr std::array<char, 4> kUnits{'K', 'M', 'G', 'T'};
    const auto found = std::find(kUnits.begin(), kUnits.end(), std::toupper(static_cast<unsigned char>(unit)));
    return found == kUnits.end() ? 0 : std::pow(base, 1.0 + static_cast<double>(found - kUnits.begin()));
}

/// Decimals that `value` has: the fewest whose text gives it back; none above 12, or for a power of two below 1, whose
/// decimals say nothing.
std::optional<int> decimalsOf(double value) {
    constexpr int kMost = 12;
    int exponent = 0;
    const double mantissa = std::frexp(std::abs(value), &exponent);
    if (mantissa == 0.5 && exponent < 1) return {};
    for (int d = 0; d <= kMost; ++d)
        if (parseNumber(fmt::format("{:.{}f}", value, d)) == value) return d;
    return {};
}

}  // namespace

std::optional<double> parseNumber(const std::string& text) {
    const auto m = parseMeasure(text);
    if (!m || !m->unit.empty()) return {};
    return m->value;
}

std::optional<uint64_t> parseCount(const std::string& text) {
    const auto m = parseMeasure(text);
    if (!m || m->unit.size() > 1) return {};
    const double factor = m->unit.empty() ? 1 : factorOf(m->unit[0], 1000);
    const double count = m->value * factor;
    if (factor == 0 || !(count >= 0) || count > 1e18 || std::signbit(m->value)) return {};
    const double whole = std::round(count);
    if (std::abs(count - whole) > 1e-6) return {};
    return static_cast<uint64_t>(whole);
}

uint64_t parseBytes(const std::string& text) {
    const auto m = parseMeasure(text);
    if (!m || !(m->value > 0) || m->value > 1e15) return 0;
    const std::string tail = m->unit.empty() ? "" : m->unit.substr(1);
    const double factor = m->unit.empty() ? 1 : factorOf(m->unit[0], 1024);
    if (!tail.empty() && tail != "B" && tail != "iB") return 0;
    const double bytes = m->value * factor;
    return bytes <= 1e18 ? static_cast<uint64_t>(bytes) : 0;
}

std::string latticeText(double value, double unit, double origin) {
    const auto ofUnit = decimalsOf(unit);
    auto ofOrigin = decimalsOf(origin);
    // What an origin has beyond the decimals of the unit, if it is next to nothing, was left over by who computed it.
    constexpr double kLeftOver = 1e-6;
    if (ofUnit && parseNumber(fmt::format("{:.{}f}", origin, *ofUnit)).has_value() &&
        std::abs(*parseNumber(fmt::format("{:.{}f}", origin, *ofUnit)) - origin) <= kLeftOver * unit)
        ofOrigin = 0;
    if (!std::isfinite(value) || !ofUnit || !ofOrigin) return fmt::format("{}", value);
    const int decimals = std::max(*ofUnit, *ofOrigin);
    std::string text = fmt::format("{:.{}f}", value, decimals);
    const bool isZero = text.find_first_of("123456789") == std::string::npos;
    return isZero ? fmt::format("{:.{}f}", 0.0, decimals) : text;
}

double latticeValue(double value, double unit, double origin) {
    return parseNumber(latticeText(value, unit, origin)).value_or(value);
}

}  // namespace stipple
