#include "apps/study/statistics/compare.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stipple::study {
namespace {

/// Where the standard normal distribution reaches `p`.
double normalQuantile(double p) {
    double low = -40, high = 40;
    for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (0.5 * std::erfc(-middle / std::sqrt(2.0)) < p ? low : high) = middle;
    }
    return low;
}

/// How many of the Walsh averages of `n` values may be left out on either side: the most for which the sum of signed
/// ranks is below it with a chance of at most `tail`; -1 where already leaving out none is too much.
int64_t leftOut(size_t n, double tail) {
    if (n > kExactRanks) {
        const auto m = static_cast<double>(n);
        const double mean = m * (m + 1) / 4, deviation = std::sqrt(m * (m + 1) * (2 * m + 1) / 24);
        return static_cast<int64_t>(std::floor(mean + normalQuantile(tail) * deviation)) - 1;
    }
    // ways[w]: shares of the 2^n signs whose positive ranks sum up to w.
    std::vector<double> ways(n * (n + 1) / 2 + 1, 0.0);
    ways[0] = 1;
    for (size_t rank = 1; rank <= n; ++rank)
        for (size_t w = ways.size(); w-- > 0;) ways[w] = 0.5 * (ways[w] + (w >= rank ? ways[w - rank] : 0));
    double below = 0;
    int64_t out = -1;
    for (size_t w = 0; w < ways.size(); ++w) {
        below += ways[w];
        if (below > tail) break;
        out = static_cast<int64_t>(w);
    }
    return out;
}

}  // namespace

Interval signedRankInterval(const std::vector<double>& values, double confidence) {
    const double all = std::numeric_limits<double>::infinity();
    if (values.empty()) return {-all, 0, all};
    std::vector<double> averages;
    for (size_t i = 0; i < values.size(); ++i)
        for (size_t k = 0; k <= i; ++k) averages.push_back(0.5 * (values[i] + values[k]));
    std::sort(averages.begin(), averages.end());
    const double middle = quantile(averages, 0.5);
    const int64_t out = leftOut(values.size(), 0.5 * (1 - confidence));
    if (out < 0) return {-all, middle, all};
    const auto at = static_cast<size_t>(out);
    return {averages[at], middle, averages[averages.size() - 1 - at]};
}

Interval ratioOf(const Visits& before, const Visits& after, double confidence) {
    std::vector<double> logs;
    for (size_t b = 0; b < std::min(before.size(), after.size()); ++b) {
        const double x = quantile(before[b], 0.5), y = quantile(after[b], 0.5);
        if (x > 0 && y > 0) logs.push_back(std::log(y / x));
    }
    const Interval i = signedRankInterval(logs, confidence);
    return {std::exp(i.low), std::exp(i.middle), std::exp(i.high)};
}

bool isAlarm(const Interval& ratio) { return ratio.low > 1 + kAlarmShare || ratio.high < 1 - kAlarmShare; }

}  // namespace stipple::study
