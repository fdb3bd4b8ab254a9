// What streams of smooth values are made of: differences without a sign, planes of bytes, octahedral steps, zstd.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "lod/store/check.h"
#include "lod/store/zstd_memory.h"

namespace stipple::lod::streams {

using Bytes = std::vector<uint8_t>;

inline Bytes compress(const Bytes& raw) {
    Bytes out(ZSTD_compressBound(raw.size()));
    ZSTD_CCtx& context = zstdContext(ZSTD_createCCtx, ZSTD_freeCCtx);
    constexpr int kZstdLevel = 9;
    out.resize(written(ZSTD_compressCCtx(&context, out.data(), out.size(), raw.data(), raw.size(), kZstdLevel)));
    return out;
}

inline std::optional<Bytes> decompress(std::span<const uint8_t> packed, size_t plain) {
    if (!isPossibleGain(packed.size(), plain)) return {};
    Bytes out(plain);
    ZSTD_DCtx& context = zstdContext(ZSTD_createDCtx, ZSTD_freeDCtx);
    const size_t got =
        unlessOutOfMemory(ZSTD_decompressDCtx(&context, out.data(), out.size(), packed.data(), packed.size()));
    if (ZSTD_isError(got) || got != plain) return {};
    return out;
}

inline uint16_t zigzag(uint16_t difference) {
    const auto v = static_cast<int16_t>(difference);
    return static_cast<uint16_t>((static_cast<uint32_t>(v) << 1) ^ static_cast<uint32_t>(v >> 15));
}
inline uint16_t unzigzag(uint16_t z) { return static_cast<uint16_t>((z >> 1) ^ (0u - (z & 1u))); }

/// Values of 16 bits: low bytes, then high bytes.
inline Bytes planes(const std::vector<uint16_t>& values) {
    Bytes out(2 * values.size());
    for (size_t k = 0; k < values.size(); ++k) {
        out[k] = static_cast<uint8_t>(values[k]);
        out[values.size() + k] = static_cast<uint8_t>(values[k] >> 8);
    }
    return out;
}
inline uint16_t fromPlanes(const Bytes& bytes, size_t k) {
    return static_cast<uint16_t>(bytes[k] | bytes[bytes.size() / 2 + k] << 8);
}

/// Octahedral steps, x and y.
inline std::array<uint32_t, 2> stepsOf(uint32_t code, uint32_t step) {
    const uint32_t round = 1 + step / 2;
    return {((code & 0xffffu) + round) / step, ((code >> 16) + round) / step};
}
inline uint32_t codeOf(uint32_t x, uint32_t y, uint32_t step) {
    constexpr uint32_t kCodes = 65536;
    const auto code = [&](uint32_t steps) { return steps == 0 ? 0 : std::min(steps * step - 1, kCodes - 2); };
    return code(x) | code(y) << 16;
}

inline uint32_t channel(uint32_t colour, int k) { return colour >> (8 * k) & 255u; }

}  // namespace stipple::lod::streams
