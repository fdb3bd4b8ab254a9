#include "lod/store/attributes.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "lod/store/check.h"
#include "lod/store/zstd_memory.h"

namespace stipple::lod {
namespace {

/// Calls `f` with a value of the C++ type that stands for `type`.
template <typename F>
auto withType(ScalarType type, F f) {
    switch (type) {
        case ScalarType::u8:
            return f(uint8_t{});
        case ScalarType::i8:
            return f(int8_t{});
        case ScalarType::u16:
            return f(uint16_t{});
        case ScalarType::i16:
            return f(int16_t{});
        case ScalarType::u32:
            return f(uint32_t{});
        case ScalarType::i32:
            return f(int32_t{});
        case ScalarType::u64:
            return f(uint64_t{});
        case ScalarType::i64:
            return f(int64_t{});
        case ScalarType::f32:
            return f(float{});
        case ScalarType::f64:
            break;
    }
    return f(double{});
}

}  // namespace

double attributeValue(const AttributeInfo& info, const uint8_t* stored) {
    return withType(info.type, [&](auto v) {
        std::memcpy(&v, stored, sizeof(v));
        return static_cast<double>(v) * info.scale + info.offset;
    });
}

bool isNoData(const AttributeInfo& info, const uint8_t* stored) {
    return withType(info.type, [&](auto v) {
        using T = decltype(v);
        std::memcpy(&v, stored, sizeof(v));
        const auto raw = static_cast<double>(v);
        if (info.noData && raw == *info.noData) return true;
        if constexpr (std::numeric_limits<T>::is_integer) return false;
        return !(std::abs(raw) < static_cast<double>(std::numeric_limits<float>::max()));
    });
}

void storeAttribute(const AttributeInfo& info, double value, uint8_t* to) {
    const double raw = (value - info.offset) / info.scale;
    withType(info.type, [&](auto v) {
        using T = decltype(v);
        if constexpr (std::numeric_limits<T>::is_integer) {
            const double least = static_cast<double>(std::numeric_limits<T>::min());
            // The largest double that T can hold: 2^64 itself is too large for 64 bits.
            const double most = std::nextafter(std::ldexp(1.0, std::numeric_limits<T>::digits), 0.0);
            v = static_cast<T>(std::isnan(raw) ? 0.0 : std::min(std::max(std::round(raw), least), std::floor(most)));
        } else {
            v = static_cast<T>(raw);
        }
        std::memcpy(to, &v, sizeof(v));
    });
}

std::vector<uint8_t> encodeAttributes(const std::vector<AttributeInfo>& infos,
                                      const std::vector<std::vector<uint8_t>>& streams) {
    std::vector<uint8_t> out(infos.size() * 4);
    for (size_t k = 0; k < infos.size(); ++k) {
        const size_t width = bytesOf(infos[k].type), records = streams[k].size() / width;
        std::vector<uint8_t> planes(streams[k].size());
        for (size_t b = 0; b < width; ++b)
            for (size_t i = 0; i < records; ++i) planes[b * records + i] = streams[k][i * width + b];
        const size_t at = out.size();
        out.resize(at + ZSTD_compressBound(planes.size()));
        const auto size = static_cast<uint32_t>(
            written(ZSTD_compress(out.data() + at, out.size() - at, planes.data(), planes.size(), 1)));
        out.resize(at + size);
        std::memcpy(out.data() + 4 * k, &size, 4);
    }
    return out;
}

Result<std::vector<uint8_t>> decodeAttribute(const uint8_t* bytes, size_t count,
                                             const std::vector<AttributeInfo>& infos, size_t index, uint32_t records,
                                             const std::string& where) {
    const auto damaged = [&] {
        return fail(ErrorKind::input, fmt::format("the stream of attribute '{}' is damaged", infos.at(index).name),
                    where, "build the store again");
    };
    size_t at = infos.size() * 4;
    if (count < at) return damaged();
    uint32_t size = 0;
    for (size_t k = 0; k <= index; ++k) {
        at += size;
        std::memcpy(&size, bytes + 4 * k, 4);
        if (at > count || size > count - at) return damaged();
    }
    const size_t width = bytesOf(infos.at(index).type);
    if (ZSTD_getFrameContentSize(bytes + at, size) != records * width || !isPossibleGain(size, records * width))
        return damaged();
    std::vector<uint8_t> planes(records * width), values(records * width);
    const size_t got = unlessOutOfMemory(ZSTD_decompress(planes.data(), planes.size(), bytes + at, size));
    if (ZSTD_isError(got) || got != planes.size()) return damaged();
    for (size_t b = 0; b < width; ++b)
        for (size_t i = 0; i < records; ++i) values[i * width + b] = planes[b * records + i];
    return values;
}

}  // namespace stipple::lod
