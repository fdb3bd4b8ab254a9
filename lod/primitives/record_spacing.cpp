#include "lod/primitives/record_spacing.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/base/lanes.h"
#include "engine/base/wide.h"

namespace stipple::lod {
namespace {

constexpr size_t kNeighbours = 6;
constexpr size_t kProbes = 24;  // their median is within a tenth of that of all
constexpr float kPi = 3.14159265f;
constexpr size_t kBlock = 2 * kLanes;    // records that follow each other, whose box is asked first
constexpr size_t kBlocksBeside = 4;      // before a record's own, and from that on
constexpr float kRoundedUp = 1 + 1e-6f;  // more than what floats may be off, here and there

using Place = std::array<float, 3>;
using Columns = std::array<std::vector<float>, 3>;

/// Of a mask's lanes a bit each.
[[gnu::always_inline]] inline uint32_t bitsOf(const Lanes& mask) {
    const auto pairs = reinterpret_cast<Pairs>(mask & Lanes{1, 2, 4, 8, 16, 32, 64, 128});
    const auto all = static_cast<uint64_t>(pairs[0] | pairs[1] | pairs[2] | pairs[3]);
    return static_cast<uint32_t>(all | all >> 32);
}
/// In all lanes the least of them.
[[gnu::always_inline]] inline void spreadLeast(Floats& v) {
    const auto keep = [&](const Floats& other) { v = other < v ? other : v; };
    keep(__builtin_shufflevector(v, v, 4, 5, 6, 7, 0, 1, 2, 3));
    keep(__builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5));
    keep(__builtin_shufflevector(v, v, 1, 0, 3, 2, 5, 4, 7, 6));
}

}  // namespace

/// Of `count` blocks of records the boxes.
STIPPLE_WIDE static void boxBlocks(const Columns& at, size_t count, Columns& lo, Columns& hi) {
    for (size_t a = 0; a < 3; ++a)
        for (size_t b = 0; b < count; ++b) {
            const Floats first = floatsAt(at[a].data(), b * kBlock).v,
                         second = floatsAt(at[a].data(), b * kBlock + kLanes).v;
            Floats least = first < second ? first : second, most = first < second ? -second : -first;
            spreadLeast(least);
            spreadLeast(most);
            lo[a][b] = least[0];
            hi[a][b] = -most[0];
        }
}

/// Which of kLanes boxes from `first` on reach within `squared` of a place, a bit each.
STIPPLE_WIDE static uint32_t boxesWithin(const Columns& lo, const Columns& hi, size_t first, const Place& from,
                                         float squared) {
    Floats sum{};
    for (size_t a = 0; a < 3; ++a) {
        const Floats below = floatsAt(lo[a].data(), first).v - from[a],
                     above = from[a] - floatsAt(hi[a].data(), first).v;
        Floats off = below > above ? below : above;
        off = off > 0.0f ? off : Floats{};
        sum += off * off;
    }
    return bitsOf(sum <= squared);
}

/// Which records of the block that begins with `first` lie within `squared` of a place, a bit each.
STIPPLE_WIDE static uint32_t recordsWithin(const Columns& at, size_t first, const Place& from, float squared) {
    uint32_t bits = 0;
    for (size_t half = 0; half < kBlock; half += kLanes) {
        Floats sum{};
        for (size_t a = 0; a < 3; ++a) {
            const Floats off = floatsAt(at[a].data(), first + half).v - from[a];
            sum += off * off;
        }
        bits |= bitsOf(sum <= squared) << half;
    }
    return bits;
}

float recordSpacing(std::span<const shared::PointRecord> records) {
    const size_t n = records.size();
    if (n <= kNeighbours) return 0;
    // Coordinates side by side, as floats, which say by SIMD what is too far away; whole numbers say the rest. (Behind
    // the last it comes again, and the last box, which changes no box and counts no more.)
    thread_local Columns at, lo, hi;
    const size_t blocks = (n + kBlock - 1) / kBlock, boxes = (blocks + kLanes - 1) / kLanes * kLanes;
    for (size_t a = 0; a < 3; ++a) {
        at[a].resize(blocks * kBlock);
        lo[a].resize(boxes);
        hi[a].resize(boxes);
    }
    for (size_t k = 0; k < n; ++k) {
        at[0][k] = static_cast<float>(shared::recordX(records[k]));
        at[1][k] = static_cast<float>(shared::recordY(records[k]));
        at[2][k] = static_cast<float>(shared::recordZ(records[k]));
    }
    for (std::vector<float>& column : at)
        std::fill(column.begin() + static_cast<ptrdiff_t>(n), column.end(), column[n - 1]);
    boxBlocks(at, blocks, lo, hi);
    for (Columns* corners : {&lo, &hi})
        for (std::vector<float>& column : *corners)
            std::fill(column.begin() + static_cast<ptrdiff_t>(blocks), column.end(), column[blocks - 1]);
    const size_t probes = std::min(kProbes, n);
    std::array<int64_t, kProbes> areas{};
    for (size_t p = 0; p < probes; ++p) {
        const size_t index = (p * 2654435761u + 12345u) % n;
        const shared::PointRecord& from = records[index];
        const auto x = int64_t{shared::recordX(from)}, y = int64_t{shared::recordY(from)},
                   z = int64_t{shared::recordZ(from)};
        const Place place{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
        std::array<int64_t, kNeighbours + 1> nearest{};  // itself comes first
        nearest.fill(std::numeric_limits<int64_t>::max());
        float limit = std::numeric_limits<float>::max();
        const auto scan = [&](size_t block) {
            const size_t first = block * kBlock, here = std::min(kBlock, n - first);
            uint32_t bits = recordsWithin(at, first, place, limit) & ((1u << here) - 1);
            for (; bits != 0; bits &= bits - 1) {
                const shared::PointRecord& r = records[first + static_cast<size_t>(std::countr_zero(bits))];
                const int64_t dx = shared::recordX(r) - x, dy = shared::recordY(r) - y, dz = shared::recordZ(r) - z;
                const int64_t squared = dx * dx + dy * dy + dz * dz;
                if (squared >= nearest.back()) continue;
                size_t to = kNeighbours;
                for (; to > 0 && nearest.at(to - 1) > squared; --to) nearest.at(to) = nearest.at(to - 1);
                nearest.at(to) = squared;
            }
            limit = static_cast<float>(nearest.back()) * kRoundedUp;
        };
        // Where it stands itself first: records lie there that are near, and most others are too far then.
        const size_t own = index / kBlock, begin = own - std::min(own, kBlocksBeside),
                     end = std::min(blocks, own + kBlocksBeside);
        for (size_t block = begin; block < end; ++block) scan(block);
        for (size_t first = 0; first < blocks; first += kLanes)
            for (uint32_t bits = boxesWithin(lo, hi, first, place, limit); bits != 0; bits &= bits - 1) {
                const size_t block = first + static_cast<size_t>(std::countr_zero(bits));
                if (block < blocks && (block < begin || block >= end)) scan(block);
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
