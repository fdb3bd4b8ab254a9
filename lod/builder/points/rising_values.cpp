#include "lod/builder/points/rising_values.h"

#include <algorithm>
#include <cstring>

#include "lod/attributes.h"

namespace stipple::lod {
namespace {

uint64_t storedBits(const AttributeInfo& info, const uint8_t* from) {
    uint64_t v = 0;
    std::memcpy(&v, from, bytesOf(info.type));
    return v;
}

}  // namespace

RisingValue leafValue(const AttributeInfo& info, const uint8_t* from) {
    return {info.aggregate == Aggregate::mean ? attributeValue(info, from) : 0, storedBits(info, from), 1};
}

RisingValue mergeValues(const AttributeInfo& info, std::span<const RisingValue> parts,
                        std::span<const Rising> records) {
    RisingValue out = parts[0];
    if (info.aggregate == Aggregate::mean) {
        double sum = 0, count = 0;  // against the first value, so that large offsets cost no digits
        for (size_t i = 0; i < parts.size(); ++i) {
            sum += records[i].count * (parts[i].mean - parts[0].mean);
            count += records[i].count;
        }
        out.mean = parts[0].mean + sum / count;
        return out;
    }
    if (info.aggregate == Aggregate::none) return out;
    // The value with most votes, the smallest of equals. (The parts voted before: the winner below may not be the
    // winner among all points.)
    thread_local std::vector<std::pair<uint64_t, uint64_t>> votes;
    votes.clear();
    for (const RisingValue& p : parts) votes.emplace_back(p.stored, p.votes);
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

void storeValue(const AttributeInfo& info, const RisingValue& value, uint32_t count, uint8_t* to) {
    if (info.aggregate == Aggregate::mean && count > 1)
        storeAttribute(info, value.mean, to);
    else
        std::memcpy(to, &value.stored, bytesOf(info.type));
}

}  // namespace stipple::lod
