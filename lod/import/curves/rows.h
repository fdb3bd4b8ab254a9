// Rows of numbers in a text, for formats made of them.
#pragma once

#include <algorithm>
#include <charconv>
#include <string_view>
#include <vector>

namespace stipple::lod {

/// Calls use(line number from 1, line) for every line that is not empty and does not begin with #.
template <typename Use>
void forLines(std::string_view text, const Use& use) {
    for (size_t at = 0, line = 1; at < text.size(); ++line) {
        const size_t end = std::min(text.find_first_of("\r\n", at), text.size());
        const std::string_view row = text.substr(at, end - at);
        at = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
        const size_t first = row.find_first_not_of(" \t");
        if (first != std::string_view::npos && row[first] != '#') use(line, row.substr(first));
    }
}

/// The same with the numbers of the line, which end where something else begins: use(line number, numbers, line).
template <typename Use>
void forRows(std::string_view text, const Use& use) {
    std::vector<double> numbers;
    forLines(text, [&](size_t line, std::string_view row) {
        numbers.clear();
        for (const char *p = row.data(), *last = row.data() + row.size(); p < last;) {
            double value = 0;
            const auto parsed = std::from_chars(p, last, value);
            if (parsed.ec != std::errc()) break;
            numbers.push_back(value);
            p = parsed.ptr;
            while (p < last && (*p == ' ' || *p == '\t' || *p == ',' || *p == ';')) ++p;
        }
        use(line, numbers, row);
    });
}

}  // namespace stipple::lod
