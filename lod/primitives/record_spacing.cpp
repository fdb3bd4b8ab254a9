#include "lod/primitives/record_spacing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace stipple::lod {
namespace {

constexpr size_t kNeighbours = 6;
constexpr size_t kProbes = 24;  // their median is within a tenth of that of all
constexpr float kPi = 3.14159265f;

}  // namespace

float recordSpacing(std::span<const shared::PointRecord> records) {
    const size_t n = records.size();
    if (n <= kNeighbours) return 0;
    const size_t probes = std::min(kProbes, n);
    std::array<int64_t, kProbes> areas{};
    for (size_t p = 0; p < probes; ++p) {
        const shared::PointRecord& from = records[(p * 2654435761u + 12345u) % n];
        const auto x = int64_t{shared::recordX(from)}, y = int64_t{shared::recordY(from)},
                   z = int64_t{shared::recordZ(from)};
        std::array<int64_t, kNeighbours + 1> nearest{};  // itself comes first
        nearest.fill(std::numeric_limits<int64_t>::max());
        for (const shared::PointRecord& r : records) {
            const int64_t dx = shared::recordX(r) - x, dy = shared::recordY(r) - y, dz = shared::recordZ(r) - z;
            const int64_t squared = dx * dx + dy * dy + dz * dz;
            if (squared >= nearest.back()) continue;
            size_t at = kNeighbours;
            for (; at > 0 && nearest.at(at - 1) > squared; --at) nearest.at(at) = nearest.at(at - 1);
            nearest.at(at) = squared;
        }
        areas.at(p) = nearest.back();
    }
    const auto middle = areas.begin() + static_cast<ptrdiff_t>(probes / 2);
    std::nth_element(areas.begin(), middle, areas.begin() + static_cast<ptrdiff_t>(probes));
    // A disc up to the sixth neighbour holds six and a half.
    return std::sqrt(kPi * static_cast<float>(*middle) / (kNeighbours + 0.5f));
}

uint8_t spacingCodeUp(float steps) {
    if (!(steps > 0)) return 0;
    uint8_t code = 1;
    while (code < 255 && spacingOfCode(code) < steps) ++code;
    return code;
}

float spacingOfCode(uint8_t code) {
    // 2^(k / 8), as literals: the same on every machine.
    constexpr std::array<float, 8> kEighths{1.0f,        1.09050773f, 1.18920712f, 1.29683955f,
                                            1.41421356f, 1.54221083f, 1.68179283f, 1.83400809f};
    if (code == 0) return 0;
    return std::ldexp(kEighths.at((code - 1u) % 8), (code - 1) / 8);
}

}  // namespace stipple::lod
