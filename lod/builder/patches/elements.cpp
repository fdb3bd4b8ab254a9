#include "lod/builder/patches/elements.h"

#include <algorithm>

namespace stipple::lod {

void setLinks(std::vector<std::pair<uint32_t, uint32_t>> pairs, SurfaceElements& elements) {
    const size_t n = elements.size();
    elements.firstLink.assign(n + 1, 0);
    for (const auto& [a, b] : pairs) {
        ++elements.firstLink[a + 1];
        ++elements.firstLink[b + 1];
    }
    for (size_t i = 0; i < n; ++i) elements.firstLink[i + 1] += elements.firstLink[i];
    std::vector<uint32_t> next(elements.firstLink.begin(), elements.firstLink.end() - 1);
    std::vector<uint32_t> all(elements.firstLink[n]);
    for (const auto& [a, b] : pairs) {
        all[next[a]++] = b;
        all[next[b]++] = a;
    }
    pairs = {};
    elements.link.clear();
    elements.link.reserve(all.size());
    for (size_t i = 0; i < n; ++i) {
        const auto begin = all.begin() + elements.firstLink[i], end = all.begin() + next[i];
        std::sort(begin, end);
        elements.firstLink[i] = static_cast<uint32_t>(elements.link.size());
        for (auto k = begin; k != end; ++k)
            if (*k != i && (elements.link.size() == elements.firstLink[i] || elements.link.back() != *k))
                elements.link.push_back(*k);
    }
    elements.firstLink[n] = static_cast<uint32_t>(elements.link.size());
}

}  // namespace stipple::lod
