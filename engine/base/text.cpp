#include "engine/base/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>

namespace stipple {
namespace {

/// Bytes of the character that begins at `at`; 0 where no valid one does.
size_t characterBytes(std::string_view s, size_t at, bool& isControl) {
    const auto byte = [&](size_t i) { return static_cast<uint8_t>(s[i]); };
    const uint32_t first = byte(at);
    isControl = first < 0x20 || first == 0x7f;
    if (first < 0x80) return 1;
    const size_t count = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
    if (first < 0xc2 || first > 0xf4 || count > s.size() - at) return 0;
    uint32_t code = first & (0x7fu >> count);
    for (size_t k = 1; k < count; ++k) {
        if ((byte(at + k) & 0xc0u) != 0x80) return 0;
        code = code << 6 | (byte(at + k) & 0x3fu);
    }
    constexpr std::array<uint32_t, 5> kLeast{0, 0, 0x80, 0x800, 0x10000};
    const bool isSurrogate = code >= 0xd800 && code <= 0xdfff;
    isControl = code < 0xa0;
    return code < kLeast.at(count) || code > 0x10ffff || isSurrogate ? 0 : count;
}

std::string escape(std::string_view text, bool withControls) {
    std::string out;
    out.reserve(text.size());
    for (size_t at = 0; at < text.size();) {
        bool isControl = false;
        const size_t count = characterBytes(text, at, isControl), taken = std::max<size_t>(count, 1);
        if (count > 0 && !(isControl && withControls))
            out.append(text.substr(at, count));
        else
            for (size_t k = at; k < at + taken; ++k) out += fmt::format("\\x{:02x}", static_cast<uint8_t>(text[k]));
        at += taken;
    }
    return out;
}

}  // namespace

std::string printable(std::string_view text) { return escape(text, true); }
std::string toUtf8(std::string_view text) { return escape(text, false); }

}  // namespace stipple
