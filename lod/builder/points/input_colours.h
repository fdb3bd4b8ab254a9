#pragma once

#include <cstdint>

namespace stipple::lod {

/// r | g << 16 | b << 32 as r | g << 8 | b << 16; `isWide`: the values have 16 bits.
inline uint32_t narrowed(uint64_t c, bool isWide) {
    const auto r = static_cast<uint32_t>(c & 0xffffu), g = static_cast<uint32_t>(c >> 16 & 0xffffu),
               b = static_cast<uint32_t>(c >> 32 & 0xffffu);
    const auto toByte = [](uint32_t wide) { return (wide + 128) / 257; };
    return isWide ? toByte(r) | toByte(g) << 8 | toByte(b) << 16 : r | g << 8 | b << 16;
}

}  // namespace stipple::lod
