// Which word was meant.
#pragma once

#include <string>
#include <vector>

namespace stipple {

/// The word of `words` that `text` was probably meant to be; empty: none is near.
std::string nearestWord(const std::string& text, const std::vector<std::string>& words);

}  // namespace stipple
