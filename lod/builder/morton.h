// Morton codes of octrees: a code for each cell, in the order of the curve.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace stipple::lod {

/// 42 bits per axis: two places may lie four thousand billion times as far apart as the cells that tell them apart.
__extension__ typedef unsigned __int128 Key;
constexpr uint32_t kMortonBits = 42;
/// Per axis, of a code that fits 63 bits.
constexpr uint32_t kShortBits = 21;

/// Bits up to the highest that is set.
inline size_t bitWidth(Key v) {
    const auto high = static_cast<uint64_t>(v >> 64);
    return static_cast<size_t>(high != 0 ? 64 + std::bit_width(high) : std::bit_width(static_cast<uint64_t>(v)));
}

/// Spreads the low 21 bits: bit i goes to bit 3i.
inline uint64_t spreadBits(uint64_t v) {
    v &= 0x1fffff;
    v = (v | v << 32) & 0x1f00000000ffffull;
    v = (v | v << 16) & 0x1f0000ff0000ffull;
    v = (v | v << 8) & 0x100f00f00f00f00full;
    v = (v | v << 4) & 0x10c30c30c30c30c3ull;
    v = (v | v << 2) & 0x1249249249249249ull;
    return v;
}
/// Of 21 bits per axis.
inline uint64_t shortMortonCode(uint64_t x, uint64_t y, uint64_t z) {
    return spreadBits(x) | spreadBits(y) << 1 | spreadBits(z) << 2;
}
inline Key mortonCode(uint64_t x, uint64_t y, uint64_t z) {
    const Key low = shortMortonCode(x, y, z);
    if ((x | y | z) >> kShortBits == 0) return low;
    return low | Key{shortMortonCode(x >> kShortBits, y >> kShortBits, z >> kShortBits)} << (3 * kShortBits);
}
/// Every third bit of the low 63.
inline uint64_t compactShort(uint64_t v) {
    v &= 0x1249249249249249ull;
    v = (v | v >> 2) & 0x10c30c30c30c30c3ull;
    v = (v | v >> 4) & 0x100f00f00f00f00full;
    v = (v | v >> 8) & 0x1f0000ff0000ffull;
    v = (v | v >> 16) & 0x1f00000000ffffull;
    v = (v | v >> 32) & 0x1fffff;
    return v;
}
inline uint64_t compactBits(Key v) {
    return compactShort(static_cast<uint64_t>(v)) | compactShort(static_cast<uint64_t>(v >> (3 * kShortBits)))
                                                        << kShortBits;
}

}  // namespace stipple::lod
