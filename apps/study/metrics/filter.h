// Planes of floats, and filters that are rows times columns. Beyond its border a plane goes on as it is there.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace stipple::study {

struct Plane {
    uint32_t width = 0, height = 0;
    std::vector<float> values;  ///< row-major
    Plane() = default;
    Plane(uint32_t w, uint32_t h) : width(w), height(h), values(size_t{w} * h) {}
};

/// `rows` along x, then `columns` along y; both of odd length, the middle one is of the pixel itself.
inline Plane filtered(const Plane& in, const std::vector<float>& rows, const std::vector<float>& columns) {
    Plane across(in.width, in.height), out(in.width, in.height);
    const auto radius = static_cast<int64_t>(rows.size() / 2), w = int64_t{in.width}, h = int64_t{in.height};
    for (int64_t y = 0; y < h; ++y)
        for (int64_t x = 0; x < w; ++x) {
            float sum = 0;
            for (int64_t k = -radius; k <= radius; ++k)
                sum += rows[static_cast<size_t>(k + radius)] *
                       in.values[static_cast<size_t>(y * w + std::clamp<int64_t>(x + k, 0, w - 1))];
            across.values[static_cast<size_t>(y * w + x)] = sum;
        }
    const auto reach = static_cast<int64_t>(columns.size() / 2);
    for (int64_t y = 0; y < h; ++y)
        for (int64_t k = -reach; k <= reach; ++k) {
            const float weight = columns[static_cast<size_t>(k + reach)];
            const float* const from = &across.values[static_cast<size_t>(std::clamp<int64_t>(y + k, 0, h - 1) * w)];
            float* const to = &out.values[static_cast<size_t>(y * w)];
            for (int64_t x = 0; x < w; ++x) to[x] += weight * from[x];
        }
    return out;
}

}  // namespace stipple::study
