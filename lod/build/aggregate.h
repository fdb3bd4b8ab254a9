// What coarse records say of the attributes below them, and the ranges of attributes over a whole cloud.
#pragma once

#include "lod/build/cloud.h"

namespace stipple::lod {

/// Writes the value that stands for points [begin, end), as the attribute's Aggregate says.
void aggregate(const CloudAttribute& attribute, uint32_t begin, uint32_t end, uint8_t* to);

/// Least and greatest value, and 2nd and 98th percentile (from at most 65,536 evenly spaced points).
struct ValueRange {
    double least = 0, greatest = 0, low = 0, high = 0;
};
template <typename ValueAt>
ValueRange rangeOf(size_t count, ValueAt valueAt) {
    ValueRange r;
    std::vector<double> sample;
    const size_t stride = count / 65536 + 1;
    bool any = false;
    for (size_t i = 0; i < count; ++i) {
        const double v = valueAt(i);
        if (!(v - v == 0)) continue;  // not a number
        r.least = any ? std::min(r.least, v) : v;
        r.greatest = any ? std::max(r.greatest, v) : v;
        any = true;
        if (i % stride == 0) sample.push_back(v);
    }
    std::sort(sample.begin(), sample.end());
    if (!sample.empty()) {
        r.low = sample[(sample.size() - 1) / 50];
        r.high = sample[(sample.size() - 1) - (sample.size() - 1) / 50];
    }
    return r;
}

}  // namespace stipple::lod
