#include "lod/build/aggregate.h"

#include <algorithm>
#include <cstring>

#include "lod/attributes.h"

namespace stipple::lod {
namespace {

void mean(const CloudAttribute& a, uint32_t begin, uint32_t end, uint8_t* to) {
    const size_t width = bytesOf(a.info.type);
    // Against the first value, so that large offsets cost no digits.
    const double first = attributeValue(a.info, a.values.data() + begin * width);
    double sum = 0;
    for (uint32_t i = begin + 1; i < end; ++i) sum += attributeValue(a.info, a.values.data() + i * width) - first;
    storeAttribute(a.info, first + sum / (end - begin), to);
}

void mode(const CloudAttribute& a, uint32_t begin, uint32_t end, uint8_t* to) {
    const size_t width = bytesOf(a.info.type);
    thread_local std::vector<uint64_t> values;
    values.clear();
    for (uint32_t i = begin; i < end; ++i) {
        uint64_t v = 0;
        std::memcpy(&v, a.values.data() + i * width, width);
        values.push_back(v);
    }
    std::sort(values.begin(), values.end());
    uint64_t best = values[0];
    size_t most = 0;
    for (size_t i = 0; i < values.size();) {
        size_t j = i;
        while (j < values.size() && values[j] == values[i]) ++j;
        if (j - i > most) {
            most = j - i;
            best = values[i];
        }
        i = j;
    }
    std::memcpy(to, &best, width);
}

}  // namespace

void aggregate(const CloudAttribute& a, uint32_t begin, uint32_t end, uint8_t* to) {
    const size_t width = bytesOf(a.info.type);
    if (end - begin == 1 || a.info.aggregate == Aggregate::none)
        std::memcpy(to, a.values.data() + begin * width, width);
    else if (a.info.aggregate == Aggregate::mean)
        mean(a, begin, end, to);
    else
        mode(a, begin, end, to);
}

}  // namespace stipple::lod
