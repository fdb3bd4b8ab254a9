#include "lod/builder/points/ranges.h"

#include <algorithm>

#include "lod/store/attributes.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kSamples = 65536;

bool isCategory(const AttributeInfo& info) { return info.aggregate == Aggregate::mode && bytesOf(info.type) == 1; }

}  // namespace

void Sampled::add(const Sampled& other) {
    if (!other.any) return;
    least = any ? std::min(least, other.least) : other.least;
    greatest = any ? std::max(greatest, other.greatest) : other.greatest;
    any = true;
    values.insert(values.end(), other.values.begin(), other.values.end());
}

double Sampled::below(double share) const {
    if (values.empty()) return 0;
    const auto last = static_cast<double>(values.size() - 1);
    return values[static_cast<size_t>(share < 0.5 ? std::floor(last * share) : last - std::floor(last * (1 - share)))];
}

ValueRanges::ValueRanges(const Frame& frame, uint64_t points, const glm::dvec3& up)
    : stride_(points / kSamples + 1),
      up_(up),
      attributes_(frame.attributes.size()),
      counts_(frame.attributes.size()),
      withoutData_(frame.attributes.size()) {}

void ValueRanges::add(const Frame& frame, const Points& points, size_t begin, size_t end, uint64_t number) {
    uint64_t until = (stride_ - number % stride_) % stride_;  // points to the next sample
    for (size_t i = begin; i < end; ++i) {
        const bool isSampled = until == 0;
        until = isSampled ? stride_ - 1 : until - 1;
        const glm::dvec3 p = points.at(i);
        for (int a = 0; a < 3; ++a) axes_.at(static_cast<size_t>(a)).add(p[a], isSampled);
        if (isSampled) height_.add(glm::dot(up_, frame.origin + frame.unit * p), true);
    }
    for (size_t a = 0; a < frame.attributes.size(); ++a) {
        const AttributeInfo& info = frame.attributes[a];
        const size_t width = bytesOf(info.type);
        const uint8_t* const values = points.attributes[a].data();
        std::array<uint64_t, 256> counts{};
        for (size_t i = begin; i < end; ++i) {
            if (isNoData(info, values + i * width))
                ++withoutData_[a];
            else
                attributes_[a].add(attributeValue(info, values + i * width), (number + i - begin) % stride_ == 0);
            if (width == 1) ++counts.at(values[i]);
        }
        for (uint64_t v = 0; isCategory(info) && v < 256; ++v)
            if (counts.at(v) > 0) counts_[a][v] += counts.at(v);
    }
}

void ValueRanges::add(const ValueRanges& other) {
    height_.add(other.height_);
    for (size_t a = 0; a < 3; ++a) axes_[a].add(other.axes_[a]);
    for (size_t a = 0; a < attributes_.size(); ++a) {
        attributes_[a].add(other.attributes_[a]);
        withoutData_[a] += other.withoutData_[a];
        for (const auto& [value, count] : other.counts_[a]) counts_[a][value] += count;
    }
}

void ValueRanges::save(ByteWriter& to) const {
    height_.save(to);
    for (const Sampled& a : axes_) a.save(to);
    for (const Sampled& a : attributes_) a.save(to);
    to.put(withoutData_);
    for (const auto& counts : counts_) {
        std::vector<std::array<uint64_t, 2>> pairs;
        pairs.reserve(counts.size());
        for (const auto& [value, count] : counts) pairs.push_back({value, count});
        to.put(pairs);
    }
}
void ValueRanges::load(ByteReader& from) {
    height_.load(from);
    for (Sampled& a : axes_) a.load(from);
    for (Sampled& a : attributes_) a.load(from);
    from.get(withoutData_);
    for (auto& counts : counts_) {
        std::vector<std::array<uint64_t, 2>> pairs;
        pairs.reserve(counts.size());
        from.get(pairs);
        for (const auto& [value, count] : pairs) counts[value] = count;
    }
}

void ValueRanges::describe(const Frame& frame, const Bounds& within, StoreDescription& description) {
    for (size_t a = 0; a < frame.attributes.size(); ++a) {
        AttributeInfo info = frame.attributes[a];
        attributes_[a].sort();
        info.withoutData = withoutData_[a];
        info.least = attributes_[a].least;
        info.greatest = attributes_[a].greatest;
        info.low = attributes_[a].below(0.02);
        info.high = attributes_[a].below(0.98);
        for (const auto& [value, count] : counts_[a]) info.counts.emplace_back(static_cast<double>(value), count);
        description.attributes.push_back(info);
    }
    height_.sort();
    description.lowHeight = height_.below(0.02);
    description.highHeight = height_.below(0.98);
    // One point in 200 lies beyond each edge; what a tenth of the extent more does not reach is stray.
    for (int a = 0; a < 3; ++a) {
        Sampled& along = axes_.at(static_cast<size_t>(a));
        std::erase_if(along.values, [&](double v) { return v < within.least[a] || v > within.greatest[a]; });
        along.sort();
        const double low = along.below(0.005), high = along.below(0.995), margin = 0.1 * (high - low);
        description.focusMin[a] = frame.origin[a] + frame.unit * std::max(along.least, low - margin);
        description.focusMax[a] = frame.origin[a] + frame.unit * std::min(along.greatest, high + margin);
    }
}

}  // namespace stipple::lod
