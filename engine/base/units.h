// Numbers as people write and read them: counts with units, and coordinates with the digits that they have.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stipple {

/// A plain decimal number ("2", "-1.5", "1e-3") and nothing else: no hexadecimal, no nan, no infinity, no rest.
std::optional<double> parseNumber(const std::string& text);
/// "500k", "1.5M", "2G" or a plain number -> how many; none if that is not a whole number from 0 to 10^18.
std::optional<uint64_t> parseCount(const std::string& text);
/// "2G", "512M", "1000000" -> bytes; 0 if it is not a size.
uint64_t parseBytes(const std::string& text);

/// A coordinate on the lattice origin + n * unit, with the decimals that unit and origin have (unit 0.01: two);
/// where those are not decimal, the shortest text that gives the same number back.
std::string latticeText(double value, double unit, double origin = 0);
/// The number nearest to that text: what sums and products added below the last decimal is gone.
double latticeValue(double value, double unit, double origin = 0);

}  // namespace stipple
