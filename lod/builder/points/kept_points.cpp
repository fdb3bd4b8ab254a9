#include "lod/builder/points/kept_points.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <utility>

namespace stipple::lod {
namespace {

constexpr size_t kPlaces = 0, kLowColours = 1, kHighColours = 2, kAttributes = 3;  // columns

/// Of what a part keeps, bytes a point of each column.
std::vector<uint64_t> columnWidths(const KeptPoints::Part& part, std::span<const size_t> widths) {
    const bool isAll = part.what == KeptPoints::What::all;
    std::vector<uint64_t> of(kAttributes + widths.size(), 0);
    of[kPlaces] = part.what == KeptPoints::What::nothing ? 0 : sizeof(glm::ivec3);
    of[kLowColours] = isAll && part.hasColour ? sizeof(uint32_t) : 0;
    of[kHighColours] = isAll && part.hasColour ? sizeof(uint16_t) : 0;
    for (size_t k = 0; isAll && k < widths.size(); ++k) of[kAttributes + k] = widths[k];
    return of;
}

}  // namespace

KeptPoints::KeptPoints(std::vector<Part> parts, std::vector<size_t> widths)
    : parts_(std::move(parts)), widths_(std::move(widths)), states_(parts_.size()) {
    for (State& state : states_) state.hasAttribute.resize(widths_.size());
    std::vector<uint64_t> sizes;
    for (const Part& part : parts_) {
        const std::vector<uint64_t> of = columnWidths(part, widths_);
        sizes.push_back(part.count * std::accumulate(of.begin(), of.end(), uint64_t{0}));
    }
    region_ = std::make_unique<HugeRegion>(sizes);
}

std::vector<uint8_t*> KeptPoints::columnsOf(size_t part) const {
    std::vector<uint8_t*> columns;
    uint8_t* at = region_->part(part).data();
    for (const uint64_t width : columnWidths(parts_[part], widths_)) {
        columns.push_back(at);
        at += parts_[part].count * width;
    }
    return columns;
}

void KeptPoints::keep(size_t part, uint64_t at, const PointBlock& block) {
    const Part& of = parts_[part];
    if (of.what == What::nothing) return;
    const std::vector<uint8_t*> columns = columnsOf(part);
    const size_t count = block.lattice.size();
    const auto copy = [&](size_t column, const auto& values, size_t width) {
        if (!values.empty()) std::memcpy(columns[column] + at * width, values.data(), count * width);
    };
    copy(kPlaces, block.lattice, sizeof(glm::ivec3));
    if (of.what == What::places) return;
    State& state = states_[part];
    state.hasMore = state.hasMore || !block.colour.empty() || !block.normal.empty() || !block.radius.empty() ||
                    !block.material.empty() || of.hasColour == block.colour16.empty();
    if (state.hasMore) return;
    for (size_t i = 0; i < block.colour16.size(); ++i) {
        const auto low = static_cast<uint32_t>(block.colour16[i]);
        const auto high = static_cast<uint16_t>(block.colour16[i] >> 32);
        std::memcpy(columns[kLowColours] + (at + i) * sizeof(low), &low, sizeof(low));
        std::memcpy(columns[kHighColours] + (at + i) * sizeof(high), &high, sizeof(high));
    }
    for (size_t k = 0; k < std::min(widths_.size(), block.attributes.size()); ++k) {
        state.hasAttribute[k] = !block.attributes[k].empty();
        copy(kAttributes + k, block.attributes[k], widths_[k]);
    }
}

PointReader KeptPoints::read(size_t part, What what) const {
    return [this, part, what, columns = columnsOf(part), at = uint64_t{0}](PointBlock& block,
                                                                           size_t limit) mutable -> Result<size_t> {
        const Part& of = parts_[part];
        const State& state = states_[part];
        const size_t count = std::min<uint64_t>(limit, of.count - at);
        const auto copy = [&](size_t column, auto& values, size_t width) {
            values.resize(count * width / sizeof(values[0]));
            if (count > 0) std::memcpy(values.data(), columns[column] + at * width, count * width);
        };
        copy(kPlaces, block.lattice, sizeof(glm::ivec3));
        if (what == What::all) {
            block.colour16.resize(of.hasColour ? count : 0);
            for (size_t i = 0; i < block.colour16.size(); ++i) {
                uint32_t low = 0;
                uint16_t high = 0;
                std::memcpy(&low, columns[kLowColours] + (at + i) * sizeof(low), sizeof(low));
                std::memcpy(&high, columns[kHighColours] + (at + i) * sizeof(high), sizeof(high));
                block.colour16[i] = low | uint64_t{high} << 32;
            }
            block.attributes.resize(widths_.size());
            for (size_t k = 0; k < widths_.size(); ++k)
                if (state.hasAttribute[k]) copy(kAttributes + k, block.attributes[k], widths_[k]);
        }
        at += count;
        return count;
    };
}

void KeptPoints::release(size_t part) {
    State& state = states_[part];
    if (std::exchange(state.isReleased, true)) return;
    state.isWhole = false;
    region_->release(part);
}

void KeptPoints::releasePlaces() {
    for (size_t i = 0; i < parts_.size(); ++i)
        if (!has(i, What::all)) release(i);
}

}  // namespace stipple::lod
