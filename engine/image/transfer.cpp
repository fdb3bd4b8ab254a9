#include "engine/image/transfer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>

#include "engine/base/check.h"
#include "engine/image/png_check.h"

namespace stipple::image {
namespace {

constexpr size_t kSignature = 8, kAround = 12;

double linearFromSrgb(double s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); }

void putWord(std::vector<char>& to, uint32_t word) {
    for (int shift = 24; shift >= 0; shift -= 8) to.push_back(static_cast<char>(word >> shift & 255u));
}

void putChunk(std::vector<char>& to, std::string_view type, const std::vector<uint8_t>& bytes) {
    putWord(to, static_cast<uint32_t>(bytes.size()));
    const size_t from = to.size();
    to.insert(to.end(), type.begin(), type.end());
    for (const uint8_t b : bytes) to.push_back(static_cast<char>(b));
    putWord(to, ~crcOfPng(~0u, reinterpret_cast<const uint8_t*>(to.data()) + from, to.size() - from));
}

/// What says that colours are of sRGB, in PNG's words or the library's.
bool saysSrgb(const char* chunk) {
    const std::string_view type(chunk + 4, 4);
    return type == "sRGB" || type == "gAMA" || (type == "tEXt" && std::string_view(chunk + 8, 15) == "oiio:ColorSpace");
}

}  // namespace

double rec709FromLinear(double light) { return light < 0.018 ? 4.5 * light : 1.099 * std::pow(light, 0.45) - 0.099; }

std::array<uint8_t, 256> rec709FromSrgb() {
    std::array<uint8_t, 256> out{};
    for (size_t s = 0; s < out.size(); ++s)
        out.at(s) = static_cast<uint8_t>(rec709FromLinear(linearFromSrgb(static_cast<double>(s) / 255)) * 255 + 0.5);
    return out;
}

void encodeRec709(render::Image& image) {
    const std::array<uint8_t, 256> table = rec709FromSrgb();
    for (uint32_t& pixel : image.rgba)
        pixel = (pixel & 0xff000000u) | uint32_t{table[pixel & 255u]} | uint32_t{table[pixel >> 8 & 255u]} << 8 |
                uint32_t{table[pixel >> 16 & 255u]} << 16;
}

void tagRec709(std::vector<char>& png) {
    constexpr uint32_t kGamma = 52'083;  // 1 / 1.92 in 1/100,000: the power that is nearest to BT.709 (least squares)
    std::vector<char> out(png.begin(), png.begin() + kSignature);
    for (size_t at = kSignature; at + kAround <= png.size();) {
        const auto byte = [&](size_t i) { return static_cast<uint32_t>(static_cast<uint8_t>(png[at + i])); };
        const size_t whole = (byte(0) << 24 | byte(1) << 16 | byte(2) << 8 | byte(3)) + kAround;
        STIPPLE_CHECK(whole <= png.size() - at);
        if (!saysSrgb(&png[at])) out.insert(out.end(), &png[at], &png[at] + whole);
        if (std::memcmp(&png[at] + 4, "IHDR", 4) == 0) {
            putChunk(out, "cICP", {1, 1, 0, 1});
            putChunk(out, "gAMA",
                     {0, static_cast<uint8_t>(kGamma >> 16 & 255u), static_cast<uint8_t>(kGamma >> 8 & 255u),
                      static_cast<uint8_t>(kGamma & 255u)});
        }
        at += whole;
    }
    png = std::move(out);
}

}  // namespace stipple::image
