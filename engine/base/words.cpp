#include "engine/base/words.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <numeric>

namespace stipple {
namespace {

std::string lowerCase(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); });
    return text;
}

/// Letters to insert, leave out, change or swap with the next to get from one word to the other (Damerau, restricted).
size_t editDistance(const std::string& a, const std::string& b) {
    std::vector<size_t> before, last(b.size() + 1), now(b.size() + 1);
    std::iota(last.begin(), last.end(), size_t{0});
    for (size_t i = 1; i <= a.size(); ++i) {
        now[0] = i;
        for (size_t j = 1; j <= b.size(); ++j) {
            now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                now[j] = std::min(now[j], before[j - 2] + 1);
        }
        before = last;
        last = now;
    }
    return last.back();
}

}  // namespace

std::string nearestWord(const std::string& text, const std::vector<std::string>& words) {
    const std::string wanted = lowerCase(text);
    std::string best;
    size_t least = std::max<size_t>(1, wanted.size() / 3) + 1;  // a third of the letters may be wrong
    for (const std::string& word : words) {
        const size_t distance = editDistance(wanted, lowerCase(word));
        if (distance >= least) continue;
        least = distance;
        best = word;
    }
    if (!best.empty() || wanted.size() < 3) return best;
    for (const std::string& word : words)  // a beginning
        if (lowerCase(word).rfind(wanted, 0) == 0) return word;
    return {};
}

}  // namespace stipple
