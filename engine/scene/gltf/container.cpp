#include "engine/scene/gltf/container.h"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>

#include "engine/base/file.h"

namespace stipple::scene::gltf {
namespace {

constexpr uint64_t kSizeLimit = uint64_t{8} << 30;
constexpr uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr int kDeepestJson = 64;

uint32_t wordAt(const std::vector<uint8_t>& bytes, size_t at) {
    uint32_t v = 0;
    std::memcpy(&v, bytes.data() + at, 4);
    return v;
}

/// Parses, and notes what the standard parser lets pass: keys that stand twice.
Result<nlohmann::json> parseJson(const char* begin, const char* end, const std::string& path) {
    if (end - begin >= 3 && std::memcmp(begin, "\xef\xbb\xbf", 3) == 0)
        return fail(ErrorKind::input, "the JSON begins with a byte order mark", path,
                    "glTF forbids it; save it as UTF-8 without");
    std::vector<std::vector<std::string>> keys;
    std::string duplicate;
    int deepest = 0;
    const auto watch = [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json& value) {
        deepest = std::max(deepest, depth);
        if (event == nlohmann::json::parse_event_t::object_start) keys.emplace_back();
        if (event == nlohmann::json::parse_event_t::object_end) keys.pop_back();
        if (event == nlohmann::json::parse_event_t::key && !keys.empty()) {
            const auto key = value.get<std::string>();
            if (std::find(keys.back().begin(), keys.back().end(), key) != keys.back().end()) duplicate = key;
            if (keys.back().size() < 64) keys.back().push_back(key);
        }
        return depth <= kDeepestJson;
    };
    try {
        nlohmann::json json = nlohmann::json::parse(begin, end, watch);
        if (deepest > kDeepestJson)
            return fail(ErrorKind::input, fmt::format("the JSON is nested deeper than {} levels", kDeepestJson), path);
        if (!duplicate.empty())
            return fail(ErrorKind::input, fmt::format("the key '{}' stands twice", duplicate), path);
        if (!json.is_object()) return fail(ErrorKind::input, "the JSON is not an object", path);
        return json;
    } catch (const std::exception& e) {
        return fail(ErrorKind::input, fmt::format("is not JSON: {}", e.what()), path, "is it a glTF file?");
    }
}

Result<void> readBinaryForm(const std::vector<uint8_t>& bytes, Container& c) {
    const auto bad = [&](const std::string& what) {
        return fail(ErrorKind::input, what, c.path, "the .glb file is damaged");
    };
    if (bytes.size() < 12) return bad(fmt::format("has {} bytes, a .glb header has 12", bytes.size()));
    if (wordAt(bytes, 4) != 2) return bad(fmt::format("has .glb version {}, expected 2", wordAt(bytes, 4)));
    const uint32_t length = wordAt(bytes, 8);
    if (length > bytes.size()) return bad(fmt::format("says it has {} bytes, but has {}", length, bytes.size()));
    if (length < 20) return bad(fmt::format("has {} bytes, too few for a chunk", length));
    c.isBinary = true;
    bool hasJson = false;
    size_t at = 12;
    for (int chunk = 0; at < length; ++chunk) {  // what follows is not part of it
        if (length - at < 8) return bad(fmt::format("ends within the head of chunk {} at offset {}", chunk, at));
        const uint32_t size = wordAt(bytes, at), type = wordAt(bytes, at + 4);
        if (size % 4 != 0)
            return bad(fmt::format("chunk {} at offset {} has {} bytes, not a multiple of 4", chunk, at, size));
        if (size > length - at - 8)
            return bad(
                fmt::format("chunk {} at offset {} has {} bytes, only {} are left", chunk, at, size, length - at - 8));
        if (chunk == 0 && type != kJsonChunk)
            return bad(fmt::format("the first chunk has type {:#x}, expected JSON", type));
        if (chunk > 0 && type == kJsonChunk)
            return bad(fmt::format("chunk {} at offset {} is a second JSON chunk", chunk, at));
        if (type == kBinaryChunk && (chunk != 1 || c.hasBinaryChunk))
            return bad(fmt::format("chunk {} at offset {} is a binary chunk, which must be the second", chunk, at));
        if (size == 0 && type != kBinaryChunk) return bad(fmt::format("chunk {} at offset {} is empty", chunk, at));
        const auto* begin = bytes.data() + at + 8;
        if (type == kJsonChunk) {
            const auto* text = reinterpret_cast<const char*>(begin);
            STIPPLE_ASSIGN(c.json, parseJson(text, text + size, c.path));
            hasJson = true;
        } else if (type == kBinaryChunk) {
            c.binary.assign(begin, begin + size);
            c.hasBinaryChunk = true;
        }
        at += 8 + size_t{size};
    }
    return hasJson ? Result<void>() : bad("holds no JSON chunk");
}

}  // namespace

Result<Container> readContainer(const std::string& path) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    Container c;
    c.path = path;
    c.folder = std::filesystem::path(path).parent_path().string();
    c.fileBytes = file.sizeBytes();
    if (c.fileBytes > kSizeLimit) return fail(ErrorKind::input, "is larger than 8 GiB", path, "split it");
    if (c.fileBytes == 0) return fail(ErrorKind::input, "is empty", path, "is the download complete?");
    std::vector<uint8_t> bytes(c.fileBytes);
    STIPPLE_TRY(file.readAt(0, bytes.data(), bytes.size()));
    const bool isNamedBinary = std::filesystem::path(path).extension() == ".glb";
    if (bytes.size() >= 4 && std::memcmp(bytes.data(), "glTF", 4) == 0) {
        STIPPLE_TRY(readBinaryForm(bytes, c));
        return c;
    }
    if (isNamedBinary) return fail(ErrorKind::input, "does not begin with glTF", path, "is it a .glb file?");
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    STIPPLE_ASSIGN(c.json, parseJson(text, text + bytes.size(), path));
    return c;
}

}  // namespace stipple::scene::gltf
