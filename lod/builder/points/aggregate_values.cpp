#include "lod/builder/points/aggregate_values.h"

#include <algorithm>
#include <cstring>

#include "lod/store/attributes.h"

namespace stipple::lod {
namespace {

uint64_t storedBits(const AttributeInfo& info, const uint8_t* from) {
    uint64_t v = 0;
    std::memcpy(&v, from, bytesOf(info.type));
    return v;
}

}  // namespace

AggregateValue leafValue(const AttributeInfo& info, const uint8_t* from) {
    if (info.aggregate != Aggregate::mean) return {0, storedBits(info, from), 1};
    if (isNoData(info, from)) return {0, storedBits(info, from), 0};
    return {attributeValue(info, from), storedBits(info, from), 1};
}

AggregateValue mergeValues(const AttributeInfo& info, std::span<const AggregateValue> parts) {
    AggregateValue out = parts[0];
    if (info.aggregate == Aggregate::mean) {
        // Of what has data; against the first value, so that large offsets cost no digits.
        const auto first =
            std::find_if(parts.begin(), parts.end(), [](const AggregateValue& p) { return p.votes > 0; });
        if (first == parts.end()) return out;
        double sum = 0, count = 0;
        for (const AggregateValue& p : parts) {
            if (p.votes == 0) continue;
            sum += static_cast<double>(p.votes) * (p.mean - first->mean);
            count += static_cast<double>(p.votes);
        }
        out.mean = first->mean + sum / count;
        out.votes = static_cast<uint64_t>(count);
        return out;
    }
    if (info.aggregate == Aggregate::none) return out;
    // The value with most votes, the smallest of equals. (The parts voted before: the winner below may not be the
    // winner among all points.)
    thread_local std::vector<std::pair<uint64_t, uint64_t>> votes;
    votes.clear();
    for (const AggregateValue& p : parts) votes.emplace_back(p.stored, p.votes);
    std::sort(votes.begin(), votes.end());
    out.votes = 0;
    for (size_t i = 0; i < votes.size();) {
        uint64_t sum = 0;
        size_t j = i;
        for (; j < votes.size() && votes[j].first == votes[i].first; ++j) sum += votes[j].second;
        if (sum > out.votes) out = {0, votes[i].first, sum};
        i = j;
    }
    return out;
}

void storeValue(const AttributeInfo& info, const AggregateValue& value, uint32_t count, uint8_t* to) {
    if (info.aggregate != Aggregate::mean || count == 1 || value.votes == 0) {
        std::memcpy(to, &value.stored, bytesOf(info.type));
        return;
    }
    storeAttribute(info, value.mean, to);
    if (isNoData(info, to)) storeAttribute(info, value.mean + info.scale, to);  // a mean that only looks like it
}

}  // namespace stipple::lod
