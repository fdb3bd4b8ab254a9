// Words for people: which one was meant, and how many there are.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stipple {

/// The word of `words` that `text` was probably meant to be; empty: none is near.
std::string nearestWord(const std::string& text, const std::vector<std::string>& words);

/// "1 file", "2 files". `many`: where it is not `one` with an s.
inline std::string counted(uint64_t count, const std::string& one, const std::string& many = "") {
    return std::to_string(count) + " " + (count == 1 ? one : many.empty() ? one + "s" : many);
}

}  // namespace stipple
