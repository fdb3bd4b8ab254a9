// What coarse records say of the attributes below them, and the ranges of attributes over a whole cloud.
#pragma once

#include "lod/build/cloud.h"

namespace stipple::lod {

/// Writes the value that stands for points [begin, end), as the attribute's Aggregate says.
void aggregate(const CloudAttribute& attribute, uint32_t begin, uint32_t end, uint8_t* to);

/// Least and greatest value; from at most 65,536 evenly spaced points: 2nd and 98th percentile, and what one point in
/// 200 lies below and above of.
struct ValueRange {
    double least = 0, greatest = 0, low = 0, high = 0, edgeLow = 0, edgeHigh = 0;
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
        const size_t last = sample.size() - 1;
        r.low = sample[last / 50];
        r.high = sample[last - last / 50];
        r.edgeLow = sample[last / 200];
        r.edgeHigh = sample[last - last / 200];
    }
    return r;
}

}  // namespace stipple::lod
