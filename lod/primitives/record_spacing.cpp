#include "lod/primitives/record_spacing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/base/wide.h"

namespace stipple::lod {
namespace {

constexpr size_t kNeighbours = 6;
constexpr size_t kProbes = 24;  // their median is within a tenth of that of all
constexpr float kPi = 3.14159265f;
constexpr size_t kLanesOfSpacing = 16, kBeside = 4 * kLanesOfSpacing;
constexpr float kRoundedUp = 1 + 1e-6f;  // more than what floats may be off, here and there

}  // namespace

/// `at`: x, y, z of the records in blocks of kLanesOfSpacing from `first`; the first block with one within `squared` of
/// `from`, or `end`.
STIPPLE_WIDE static size_t blockWithin(const float* const (&at)[3], size_t first, size_t end, const float (&from)[3],
                                       float squared) {
    for (; first < end; first += kLanesOfSpacing) {
        int32_t isNear = 0;
        for (size_t k = first; k < first + kLanesOfSpacing; ++k) {
            const float dx = at[0][k] - from[0], dy = at[1][k] - from[1], dz = at[2][k] - from[2];
            isNear |= dx * dx + dy * dy + dz * dz <= squared ? 1 : 0;
        }
        if (isNear != 0) break;
    }
    return first;
}

float recordSpacing(std::span<const shared::PointRecord> records) {
    const size_t n = records.size();
    if (n <= kNeighbours) return 0;
    // Coordinates side by side, as floats, which say by SIMD what is too far away; whole numbers say the rest. (Those
    // behind the last are too far from anything.)
    thread_local std::vector<float> xs, ys, zs;
    const size_t padded = (n + kLanesOfSpacing - 1) / kLanesOfSpacing * kLanesOfSpacing;
    for (auto* column : {&xs, &ys, &zs}) {
        column->resize(padded);
        std::fill(column->begin() + static_cast<ptrdiff_t>(n), column->end(), 1e9f);
    }
    for (size_t k = 0; k < n; ++k) {
        xs[k] = static_cast<float>(shared::recordX(records[k]));
        ys[k] = static_cast<float>(shared::recordY(records[k]));
        zs[k] = static_cast<float>(shared::recordZ(records[k]));
    }
    const size_t probes = std::min(kProbes, n);
    std::array<int64_t, kProbes> areas{};
    for (size_t p = 0; p < probes; ++p) {
        const size_t index = (p * 2654435761u + 12345u) % n;
        const shared::PointRecord& from = records[index];
        const auto x = int64_t{shared::recordX(from)}, y = int64_t{shared::recordY(from)},
                   z = int64_t{shared::recordZ(from)};
        const float place[3] = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        std::array<int64_t, kNeighbours + 1> nearest{};  // itself comes first
        nearest.fill(std::numeric_limits<int64_t>::max());
        float limit = std::numeric_limits<float>::max();
        const auto scan = [&](size_t first, size_t end) {
            for (; (first = blockWithin({xs.data(), ys.data(), zs.data()}, first, end, place, limit)) < end;
                 first += kLanesOfSpacing) {
                for (size_t k = first; k < std::min(n, first + kLanesOfSpacing); ++k) {
                    const float fx = xs[k] - place[0], fy = ys[k] - place[1], fz = zs[k] - place[2];
                    if (fx * fx + fy * fy + fz * fz > limit) continue;
                    const int64_t dx = shared::recordX(records[k]) - x, dy = shared::recordY(records[k]) - y,
                                  dz = shared::recordZ(records[k]) - z;
                    const int64_t squared = dx * dx + dy * dy + dz * dz;
                    if (squared >= nearest.back()) continue;
                    size_t at = kNeighbours;
                    for (; at > 0 && nearest.at(at - 1) > squared; --at) nearest.at(at) = nearest.at(at - 1);
                    nearest.at(at) = squared;
                }
                limit = static_cast<float>(nearest.back()) * kRoundedUp;
            }
        };
        // Where it stands itself first: records lie there that are near, and most others are too far then.
        const size_t own = index / kLanesOfSpacing * kLanesOfSpacing, begin = own - std::min(own, kBeside),
                     end = std::min(padded, own + kBeside);
        scan(begin, end);
        scan(0, begin);
        scan(end, padded);
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
