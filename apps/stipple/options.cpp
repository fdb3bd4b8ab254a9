#include "apps/stipple/options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "engine/base/units.h"

namespace stipple::app {
namespace {

std::string wrongNumber(const std::string& text, const std::string& least, const std::string& most) {
    return fmt::format("'{}' is not a number from {} to {}", text, least, most);
}

/// Without the zeros of a large round number.
std::string shortCount(int64_t value) {
    for (const auto& [unit, factor] :
         {std::pair{'G', int64_t{1'000'000'000}}, std::pair{'M', int64_t{1'000'000}}, std::pair{'k', int64_t{1000}}})
        if (value >= factor && value % factor == 0) return fmt::format("{}{}", value / factor, unit);
    return std::to_string(value);
}

}  // namespace

CLI::Validator oneOf(std::vector<std::string> words) {
    const std::string list = fmt::format("{{{}}}", fmt::join(words, ","));
    return CLI::Validator(
        [words = std::move(words)](std::string& text) -> std::string {
            if (std::find(words.begin(), words.end(), text) != words.end()) return {};
            const std::string nearest = nearestWord(text, words);
            return fmt::format("'{}' is none of {}{}", text, fmt::join(words, ", "),
                               nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest));
        },
        list);
}

CLI::Validator withinWhole(int64_t least, int64_t most) {
    return CLI::Validator(
        [least, most](std::string& text) -> std::string {
            const bool isNegative = !text.empty() && text[0] == '-';
            const auto count = parseCount(isNegative ? text.substr(1) : text);
            const int64_t value = count ? (isNegative ? -1 : 1) * static_cast<int64_t>(*count) : 0;
            if (!count || value < least || value > most)
                return fmt::format("'{}' is not a whole number from {} to {}", text, shortCount(least),
                                   shortCount(most));
            text = std::to_string(value);
            return {};
        },
        "");
}

CLI::Validator withinReal(double least, double most) {
    return CLI::Validator(
        [least, most](std::string& text) -> std::string {
            const auto value = parseNumber(text);
            if (value && *value >= least && *value <= most) return {};
            return wrongNumber(text, fmt::format("{}", least), fmt::format("{}", most));
        },
        "");
}

CLI::Validator positive() {
    return CLI::Validator(
        [](std::string& text) -> std::string {
            const auto value = parseNumber(text);
            return value && *value > 0 ? "" : fmt::format("'{}' is not a number above 0", text);
        },
        "");
}

CLI::Validator bytes() {
    return CLI::Validator(
        [](std::string& text) -> std::string {
            return parseBytes(text) > 0 ? "" : fmt::format("'{}' is not a size; give e.g. 512M or 2G", text);
        },
        "");
}

}  // namespace stipple::app
