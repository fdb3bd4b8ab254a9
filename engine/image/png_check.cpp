#include "engine/image/png_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <vector>

namespace stipple::image {

uint32_t crcOfPng(uint32_t crc, const uint8_t* bytes, size_t count) {
    static const auto table = [] {
        std::array<uint32_t, 256> t{};
        for (uint32_t n = 0; n < 256; ++n) {
            uint32_t c = n;
            for (int k = 0; k < 8; ++k) c = (c & 1u) != 0 ? 0xedb88320u ^ c >> 1 : c >> 1;
            t.at(n) = c;
        }
        return t;
    }();
    for (size_t i = 0; i < count; ++i) crc = table[(crc ^ bytes[i]) & 255u] ^ crc >> 8;
    return crc;
}

namespace {

constexpr uint64_t kSignature = 8, kAround = 12;  ///< bytes: of the file; length, type and checksum of a chunk

uint32_t word(const uint8_t* b) {
    return static_cast<uint32_t>(b[0]) << 24 | static_cast<uint32_t>(b[1]) << 16 | static_cast<uint32_t>(b[2]) << 8 |
           b[3];
}

}  // namespace

Result<std::string> faultOfPng(uint64_t bytes, const ReadAt& readAt, bool wholly) {
    std::vector<uint8_t> buffer(size_t{1} << 16);
    uint64_t at = kSignature;
    for (;;) {
        if (bytes < at + kAround) return fmt::format("ends after {} bytes, in the middle of the picture", bytes);
        std::array<uint8_t, 8> head{};
        STIPPLE_TRY(readAt(at, head.data(), head.size()));
        const uint64_t length = word(head.data());
        const std::string type(reinterpret_cast<const char*>(head.data()) + 4, 4);
        if (!std::all_of(type.begin(), type.end(), [](char c) { return std::isalpha(static_cast<unsigned char>(c)); }))
            return fmt::format("is damaged at byte {}", at);
        if (!wholly && type == "IDAT") return std::string();
        if (length > bytes - at - kAround)
            return fmt::format("ends after {} bytes, in the middle of the picture", bytes);
        uint32_t crc = crcOfPng(~0u, head.data() + 4, 4);
        for (uint64_t done = 0; done < length;) {
            const auto count = static_cast<size_t>(std::min<uint64_t>(buffer.size(), length - done));
            STIPPLE_TRY(readAt(at + 8 + done, buffer.data(), count));
            crc = crcOfPng(crc, buffer.data(), count);
            done += count;
        }
        std::array<uint8_t, 4> sum{};
        STIPPLE_TRY(readAt(at + 8 + length, sum.data(), sum.size()));
        const bool isNeeded = std::isupper(static_cast<unsigned char>(type[0])) != 0;
        if (isNeeded && (crc ^ ~0u) != word(sum.data()))
            return fmt::format("is damaged between bytes {} and {}", at, at + kAround + length);
        at += kAround + length;
        if (type == "IEND") return std::string();
    }
}

}  // namespace stipple::image
