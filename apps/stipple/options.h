// What the values of options may be, and how that is said.
#pragma once

#include <CLI/CLI.hpp>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/base/words.h"

namespace stipple::app {

/// One of these words; for another, the nearest is proposed. `->check(oneOf({...}))`.
CLI::Validator oneOf(std::vector<std::string> words);

/// Takes the old name of a word for the word. `->transform(oldName("strands", "curves"))`.
inline CLI::Validator oldName(const std::string& old, const std::string& word) {
    return {[old, word](std::string& given) {
                if (given == old) given = word;
                return std::string();
            },
            ""};
}

CLI::Validator withinWhole(int64_t least, int64_t most);
CLI::Validator withinReal(double least, double most);
/// A number from `least` to `most`: of a whole-number type "500k", "1.5M" and "2G" too. Decimal, finite.
/// `->transform(within(1, 100))`.
template <typename T>
CLI::Validator within(T least, T most) {
    if constexpr (std::is_integral_v<T>)
        return withinWhole(static_cast<int64_t>(least), static_cast<int64_t>(most));
    else
        return withinReal(least, most);
}
/// Above 0. `->transform(positive())`.
CLI::Validator positive();
/// A number of bytes: "512M", "4G". `->check(bytes())`.
CLI::Validator bytes();

}  // namespace stipple::app
