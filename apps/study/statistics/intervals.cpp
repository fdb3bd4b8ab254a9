#include "apps/study/statistics/intervals.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/rng.h"

namespace stipple::study {

double quantile(std::vector<double> values, double q) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const double at = std::clamp(q, 0.0, 1.0) * static_cast<double>(values.size() - 1);
    const auto below = static_cast<size_t>(at);
    const auto begin = values.begin(), low = begin + static_cast<std::ptrdiff_t>(below);
    std::nth_element(begin, low, values.end());
    if (below + 1 == values.size()) return *low;
    const double next = *std::min_element(low + 1, values.end());
    return *low + (at - static_cast<double>(below)) * (next - *low);
}

std::vector<double> pooled(const Blocks& blocks) {
    std::vector<double> all;
    for (const auto& block : blocks) all.insert(all.end(), block.begin(), block.end());
    return all;
}

Interval bootstrapQuantile(const Blocks& blocks, double q, double confidence, uint64_t seed, int draws) {
    Rng rng(seed);
    std::vector<double> found, values;
    for (int d = 0; d < draws; ++d) {
        values.clear();
        for (size_t b = 0; b < blocks.size(); ++b) {
            const auto& block = blocks[rng.below(blocks.size())];
            values.insert(values.end(), block.begin(), block.end());
        }
        found.push_back(quantile(values, q));
    }
    const double tail = 0.5 * (1 - confidence);
    return {quantile(found, tail), quantile(pooled(blocks), q), quantile(found, 1 - tail)};
}

}  // namespace stipple::study
