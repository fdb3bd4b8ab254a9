#include "engine/scene/gltf/accessors.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/base/huge_buffer.h"
#include "engine/scene/gltf/json_tools.h"
#include "engine/scene/gltf/semantics.h"

namespace stipple::scene::gltf {
namespace {

using nlohmann::json;

/// Base64 of RFC 4648; false at a character that does not belong.
bool decodeBase64(std::string_view text, std::vector<uint8_t>& out) {
    uint32_t bits = 0;
    int have = 0;
    while (!text.empty() && text.back() == '=') text.remove_suffix(1);
    out.reserve(text.size() * 3 / 4);
    for (const char c : text) {
        const int v = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+' || c == '-' ? 62
                      : c == '/' || c == '_' ? 63
                                             : -1;
        if (v < 0) return false;
        bits = bits << 6 | static_cast<uint32_t>(v);
        have += 6;
        if (have >= 8) out.push_back(static_cast<uint8_t>(bits >> (have -= 8)));
    }
    return true;
}

/// The bytes behind a URI: data, or a file beside the glTF file (or what stands for one).
Result<std::vector<uint8_t>> fetch(const Container& c, const std::string& uri, const std::string& where,
                                   const ReadSettings& settings) {
    std::vector<uint8_t> bytes;
    if (uri.rfind("data:", 0) == 0) {
        const size_t comma = uri.find(',');
        if (comma == std::string::npos) return fail(ErrorKind::input, "the data URI has no comma", where);
        if (uri.substr(0, comma).find(";base64") == std::string::npos) {
            const std::string text = decodePercent(uri.substr(comma + 1));
            bytes.assign(text.begin(), text.end());
        } else if (!decodeBase64(std::string_view(uri).substr(comma + 1), bytes)) {
            return fail(ErrorKind::input, "the data URI is not base64", where);
        }
        return bytes;
    }
    const bool isAddress = uri.find("://") != std::string::npos;
    if (isAddress && !c.resolve)
        return fail(ErrorKind::input, fmt::format("lies at {}, and only local files are read", uri), where,
                    "download it first");
    return readNamed(c.resolve, c.folder, isAddress ? uri : nameOfUri(uri), settings);
}

double component(const uint8_t* at, int type, bool normalised) {
    const auto get = [&](auto v) {
        std::memcpy(&v, at, sizeof(v));
        return static_cast<double>(v);
    };
    switch (type) {
        case 5120:
            return normalised ? std::max(get(int8_t{}) / 127.0, -1.0) : get(int8_t{});
        case 5121:
            return normalised ? get(uint8_t{}) / 255.0 : get(uint8_t{});
        case 5122:
            return normalised ? std::max(get(int16_t{}) / 32767.0, -1.0) : get(int16_t{});
        case 5123:
            return normalised ? get(uint16_t{}) / 65535.0 : get(uint16_t{});
        case 5125:
            return get(uint32_t{});
        default:
            return get(float{});
    }
}

/// What component() gives of floats that stand side by side in each element.
void widenFloats(const uint8_t* from, size_t count, size_t stride, size_t components, double* to) {
    for (size_t i = 0; i < count; ++i, from += stride)
        for (size_t k = 0; k < components; ++k) {
            float value = 0;
            std::memcpy(&value, from + k * sizeof(float), sizeof(float));
            *to++ = static_cast<double>(value);
        }
}

/// Byte offset of each component within an element (matrix columns are padded to four bytes).
std::vector<size_t> componentOffsets(const std::string& type, int componentType) {
    const size_t bytes = componentBytes(componentType), count = componentsOf(type);
    const size_t rows = type == "MAT2" ? 2 : type == "MAT3" ? 3 : type == "MAT4" ? 4 : count;
    const size_t column = rows == count ? rows * bytes : (rows * bytes + 3) / 4 * 4;
    std::vector<size_t> offsets;
    for (size_t i = 0; i < count; ++i) offsets.push_back(i / rows * column + i % rows * bytes);
    return offsets;
}

}  // namespace

Result<void> Buffers::fits(uint64_t bytes, const std::string& what) const {
    const uint64_t most = settings_.memoryBytes;
    if (bytes <= most && claimedBytes_ <= most - bytes) return {};
    return overBudget(what, bytes < UINT64_MAX - claimedBytes_ ? bytes + claimedBytes_ : bytes, most, container_.path);
}

Result<void> Buffers::claim(uint64_t bytes, const std::string& what) {
    STIPPLE_TRY(fits(bytes, what));
    claimedBytes_ += bytes;
    return {};
}

Result<void> Buffers::load(Problems& problems) {
    STIPPLE_TRY(claim(container_.fileBytes, "the file"));
    const json& buffers = arrayOf(container_.json, "buffers");
    buffers_.resize(buffers.size());
    for (size_t i = 0; i < buffers.size(); ++i) {
        const std::string where = fmt::format("{}: /buffers/{}", container_.path, i);
        if (!buffers[i].contains("uri")) {
            if (i == 0 && container_.hasBinaryChunk) {
                STIPPLE_TRY(claim(container_.binary.size(), "the buffers"));
                buffers_[0] = std::move(container_.binary);
            }
            continue;  // otherwise the empty proxy of a compressed one
        }
        STIPPLE_ASSIGN(buffers_[i], fetch(container_, buffers[i]["uri"].get<std::string>(), where, settings_));
        STIPPLE_TRY(claim(buffers_[i].size(), "the buffers"));
        if (buffers_[i].size() < buffers[i]["byteLength"].get<uint64_t>())
            sayHarmless(problems, fmt::format("/buffers/{}", i),
                        fmt::format("has {} bytes instead of {}", buffers_[i].size(), buffers[i]["byteLength"].dump()));
    }
    return {};
}

Result<void> Buffers::decompress(size_t index) {
    const json& view = container_.json["bufferViews"][index];
    const json& c = meshoptOf(view);
    const std::string where = fmt::format("{}: /bufferViews/{}", container_.path, index);
    const auto& source = buffers_[c["buffer"].get<size_t>()];
    const auto offset = c.value("byteOffset", size_t{0}), length = c["byteLength"].get<size_t>();
    const auto count = c["count"].get<size_t>(), stride = c["byteStride"].get<size_t>();
    const auto mode = c["mode"].get<std::string>(), filter = c.value("filter", std::string("NONE"));
    if (offset > source.size() || length > source.size() - offset)
        return fail(ErrorKind::input, "the compressed bytes reach beyond their buffer", where);
    if (stride == 0 || count > UINT64_MAX / stride || count * stride != view["byteLength"].get<size_t>())
        return fail(
            ErrorKind::input,
            fmt::format("{} elements of {} bytes are not the {} of the view", count, stride, view["byteLength"].dump()),
            where);
    // The densest index code spends one byte a triangle, a vertex block 2 bits a group of 16 bytes.
    if (count * stride > (length + 64) * 1024)
        return fail(ErrorKind::input, "is too small for what it promises", where);
    if ((mode == "ATTRIBUTES" && stride % 4 != 0) || (mode != "ATTRIBUTES" && stride != 2 && stride != 4) ||
        (mode == "TRIANGLES" && count % 3 != 0))
        return fail(ErrorKind::input,
                    fmt::format("{} of {} elements with {} bytes is not possible", mode, count, stride), where);
    constexpr uint8_t kNewerVertices = 0xa1;
    if (filter == "COLOR" || (mode == "ATTRIBUTES" && length > 0 && source[offset] == kNewerVertices))
        return fail(ErrorKind::input,
                    filter == "COLOR"
                        ? "is compressed with the filter COLOR of KHR_meshopt_compression, which is not read"
                        : "is compressed with codec 1 of KHR_meshopt_compression, which is not read",
                    where, "save it with EXT_meshopt_compression, or not compressed");
    STIPPLE_TRY(claim(count * stride, "the compressed buffers"));
    std::vector<uint8_t> out(count * stride);
    const uint8_t* from = source.data() + offset;
    const int failed = mode == "ATTRIBUTES"  ? meshopt_decodeVertexBuffer(out.data(), count, stride, from, length)
                       : mode == "TRIANGLES" ? meshopt_decodeIndexBuffer(out.data(), count, stride, from, length)
                                             : meshopt_decodeIndexSequence(out.data(), count, stride, from, length);
    if (failed != 0) return fail(ErrorKind::input, "the compressed bytes are damaged", where);
    const bool fits = filter == "NONE" || (mode == "ATTRIBUTES" && (filter == "OCTAHEDRAL" ? stride == 4 || stride == 8
                                                                    : filter == "QUATERNION" ? stride == 8
                                                                                             : true));
    if (!fits)
        return fail(ErrorKind::input, fmt::format("the filter {} does not go with {} bytes", filter, stride), where);
    if (filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), count, stride);
    if (filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), count, stride);
    if (filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), count, stride);
    decompressed_[index] = std::move(out);
    return {};
}

Result<std::span<const uint8_t>> Buffers::view(size_t index) {
    const json& view = container_.json["bufferViews"][index];
    if (!meshoptOf(view).is_null()) {
        if (decompressed_.count(index) == 0) STIPPLE_TRY(decompress(index));
        return std::span<const uint8_t>(decompressed_[index]);
    }
    const auto& buffer = buffers_[view["buffer"].get<size_t>()];
    const auto offset = view.value("byteOffset", size_t{0}), length = view["byteLength"].get<size_t>();
    if (offset > buffer.size() || length > buffer.size() - offset)
        return fail(ErrorKind::input, fmt::format("reaches beyond the {} bytes of its buffer", buffer.size()),
                    fmt::format("{}: /bufferViews/{}", container_.path, index), "the buffer is truncated");
    return std::span<const uint8_t>(buffer).subspan(offset, length);
}

Result<std::vector<double>> Buffers::values(size_t index) {
    const json& a = container_.json["accessors"][index];
    const auto type = a["type"].get<std::string>();
    const int componentType = a["componentType"].get<int>();
    const auto count = a["count"].get<size_t>();
    const std::vector<size_t> offsets = componentOffsets(type, componentType);
    // An accessor without bytes behind it may promise any number.
    constexpr uint64_t kEach = sizeof(double);
    STIPPLE_TRY(fits(count > UINT64_MAX / kEach / offsets.size() ? UINT64_MAX : count * offsets.size() * kEach,
                     fmt::format("/accessors/{} with {} elements", index, count)));
    std::vector<double> out;
    resizeHuge(out, count * offsets.size());
    if (count == 0) return out;
    if (a.contains("bufferView")) {
        const auto viewIndex = a["bufferView"].get<size_t>();
        STIPPLE_ASSIGN(const std::span<const uint8_t> bytes, view(viewIndex));
        const json& v = container_.json["bufferViews"][viewIndex];
        const size_t element = elementBytes(type, componentType), stride = v.value("byteStride", element);
        const size_t first = a.value("byteOffset", size_t{0});
        if (first + (count - 1) * stride + lastElementBytes(type, componentType) > bytes.size())
            return fail(ErrorKind::input, "reaches beyond its buffer view",
                        fmt::format("{}: /accessors/{}", container_.path, index));
        const bool normalised = a.value("normalized", false);
        const bool isPlain = componentType == 5126 && offsets.back() == (offsets.size() - 1) * sizeof(float);
        if (isPlain) widenFloats(bytes.data() + first, count, stride, offsets.size(), out.data());
        for (size_t i = 0; i < count && !isPlain; ++i)
            for (size_t k = 0; k < offsets.size(); ++k)
                out[i * offsets.size() + k] =
                    component(bytes.data() + first + i * stride + offsets[k], componentType, normalised);
    }
    if (a.contains("sparse")) STIPPLE_TRY(addSparse(a, offsets.size(), out));
    return out;
}

Result<void> Buffers::addSparse(const json& a, size_t components, std::vector<double>& values) {
    const json& s = a["sparse"];
    const auto type = a["type"].get<std::string>();
    const int componentType = a["componentType"].get<int>(), indexType = s["indices"]["componentType"].get<int>();
    STIPPLE_ASSIGN(const std::span<const uint8_t> indexBytes, view(s["indices"]["bufferView"].get<size_t>()));
    STIPPLE_ASSIGN(const std::span<const uint8_t> valueBytes, view(s["values"]["bufferView"].get<size_t>()));
    const size_t indexAt = s["indices"].value("byteOffset", size_t{0}),
                 valueAt = s["values"].value("byteOffset", size_t{0});
    const std::vector<size_t> offsets = componentOffsets(type, componentType);
    const size_t element = elementBytes(type, componentType), indexSize = componentBytes(indexType);
    double last = -1;
    for (size_t i = 0; i < s["count"].get<size_t>(); ++i) {
        const double index = component(indexBytes.data() + indexAt + i * indexSize, indexType, false);
        if (!(index > last) || index >= static_cast<double>(values.size() / components))
            return fail(ErrorKind::input, fmt::format("sparse index {} is not in order or not in range", index),
                        container_.path);
        last = index;
        for (size_t k = 0; k < components; ++k)
            values[static_cast<size_t>(index) * components + k] = component(
                valueBytes.data() + valueAt + i * element + offsets[k], componentType, a.value("normalized", false));
    }
    return {};
}

Result<std::vector<uint32_t>> Buffers::indices(size_t accessor) {
    STIPPLE_ASSIGN(const std::vector<double> read, values(accessor));
    return std::vector<uint32_t>(read.begin(), read.end());
}

bool Buffers::hasData(const json& accessor) const {
    const auto isThere = [&](size_t viewIndex) {
        const json& view = container_.json["bufferViews"][viewIndex];
        return !meshoptOf(view).is_null() || !buffers_[view["buffer"].get<size_t>()].empty();
    };
    if (accessor.contains("bufferView") && !isThere(accessor["bufferView"].get<size_t>())) return false;
    if (!accessor.contains("sparse")) return accessor.contains("bufferView");
    return isThere(accessor["sparse"]["indices"]["bufferView"].get<size_t>()) &&
           isThere(accessor["sparse"]["values"]["bufferView"].get<size_t>());
}

Result<std::vector<uint8_t>> Buffers::image(size_t index) {
    const json& image = container_.json["images"][index];
    if (image.contains("uri"))
        return fetch(container_, image["uri"].get<std::string>(), fmt::format("{}: /images/{}", container_.path, index),
                     settings_);
    if (!image.contains("bufferView"))
        return fail(ErrorKind::input, "has neither a 'uri' nor a 'bufferView'",
                    fmt::format("{}: /images/{}", container_.path, index));
    STIPPLE_ASSIGN(const std::span<const uint8_t> bytes, view(image["bufferView"].get<size_t>()));
    return std::vector<uint8_t>(bytes.begin(), bytes.end());
}

}  // namespace stipple::scene::gltf
