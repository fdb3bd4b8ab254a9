#include "engine/scene/gltf/container.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <set>

#include "engine/base/file.h"
#include "engine/base/huge_buffer.h"
#include "engine/scene/read_settings.h"

namespace stipple::scene::gltf {
namespace {

constexpr uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr int kDeepestJson = 64;

template <size_t count>
Result<std::array<uint32_t, count>> wordsAt(const ByteSource& file, uint64_t at) {
    std::array<uint32_t, count> words{};
    STIPPLE_TRY(file.readAt(at, words.data(), sizeof(words)));
    return words;
}

/// Looks for what the parser lets pass: keys that stand twice, and depth (it would recurse when freeing).
class Watcher final : public nlohmann::json_sax<nlohmann::json> {
  public:
    std::string duplicate;
    bool tooDeep = false;

    bool null() override { return true; }
    bool boolean(bool /*value*/) override { return true; }
    bool number_integer(number_integer_t /*value*/) override { return true; }
    bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
    bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
    bool string(string_t& /*value*/) override { return true; }
    bool binary(binary_t& /*value*/) override { return true; }
    bool start_object(std::size_t /*elements*/) override {
        keys_.emplace_back();
        return deeper();
    }
    bool end_object() override {
        keys_.pop_back();
        --depth_;
        return true;
    }
    bool start_array(std::size_t /*elements*/) override { return deeper(); }
    bool end_array() override {
        --depth_;
        return true;
    }
    bool key(string_t& name) override {
        if (!keys_.back().insert(name).second) duplicate = name;
        return duplicate.empty();
    }
    bool parse_error(std::size_t /*at*/, const std::string& /*token*/,
                     const nlohmann::json::exception& /*e*/) override {
        return false;  // said by the parser that follows
    }

  private:
    bool deeper() {
        tooDeep = ++depth_ > kDeepestJson;
        return !tooDeep;
    }
    std::vector<std::set<std::string>> keys_;
    int depth_ = 0;
};

/// What the values of a JSON text take, from what separates them (about 100 bytes a member, rounded up).
uint64_t memoryOfJson(const char* begin, const char* end) {
    uint64_t bytes = 0;
    bool inText = false;
    for (const char* p = begin; p < end; ++p) {
        if (inText && *p == '\\')
            ++p;
        else if (*p == '"')
            inText = !inText;
        else if (!inText)
            bytes += *p == ':' ? 120 : *p == ',' ? 24 : *p == '{' || *p == '[' ? 64 : 0;
    }
    return bytes + static_cast<uint64_t>(end - begin);
}

/// Where a UTF-8 text is none, from `p` on (RFC 3629; what a parser of JSON takes); `end`: nowhere.
const char* faultOfUtf8(const char* p, const char* end) {
    while (p < end) {
        const auto lead = static_cast<unsigned char>(*p);
        const int more = lead < 0x80 ? 0 : lead < 0xc2 ? -1 : lead < 0xe0 ? 1 : lead < 0xf0 ? 2 : lead < 0xf5 ? 3 : -1;
        if (more < 0 || end - p <= more) return p;
        for (int k = 1; k <= more; ++k) {
            const auto c = static_cast<unsigned char>(p[k]);
            const unsigned least = k > 1          ? 0x80
                                   : lead == 0xe0 ? 0xa0
                                   : lead == 0xf0 ? 0x90
                                                  : 0x80,
                           most = k > 1          ? 0xbf
                                  : lead == 0xed ? 0x9f
                                  : lead == 0xf4 ? 0x8f
                                                 : 0xbf;
            if (c < least || c > most) return p;
        }
        p += 1 + more;
    }
    return end;
}

Result<nlohmann::json> parseJson(const char* begin, const char* end, Container& c, uint64_t memoryBytes) {
    const std::string& path = c.path;
    if (end - begin >= 3 && std::memcmp(begin, "\xef\xbb\xbf", 3) == 0) {
        begin += 3;
        c.oddities.emplace_back("the JSON begins with a byte order mark");
    }
    if (end > begin && end[-1] == '\0') c.oddities.emplace_back("the JSON ends with zeros");
    while (end > begin && end[-1] == '\0') --end;
    std::string mended;  // names in another character set
    if (const char* fault = faultOfUtf8(begin, end); fault < end) {
        c.oddities.push_back(fmt::format("the JSON is not UTF-8 (at byte {})", fault - begin));
        mended.assign(begin, end);
        begin = mended.data();
        end = begin + mended.size();
        for (const char* p = begin; (p = faultOfUtf8(p, end)) < end;) mended[static_cast<size_t>(p - begin)] = '?';
    }
    if (const uint64_t needed = memoryOfJson(begin, end); needed > memoryBytes)
        return overBudget("its JSON", needed, memoryBytes, path);
    Watcher watcher;
    nlohmann::json::sax_parse(begin, end, &watcher);
    if (watcher.tooDeep)
        return fail(ErrorKind::input, fmt::format("the JSON is nested deeper than {} levels", kDeepestJson), path);
    if (!watcher.duplicate.empty())
        return fail(ErrorKind::input, fmt::format("the key '{}' stands twice", watcher.duplicate), path);
    try {
        nlohmann::json json = nlohmann::json::parse(begin, end);
        if (!json.is_object()) return fail(ErrorKind::input, "the JSON is not an object", path);
        return json;
    } catch (const nlohmann::json::parse_error& e) {
        return fail(ErrorKind::input, fmt::format("is not JSON (at byte {})", e.byte), path, "is it a glTF file?");
    } catch (const nlohmann::json::exception&) {
        return fail(ErrorKind::input, "its JSON holds a number that is too large", path, "is it a glTF file?");
    }
}

tl::unexpected<Error> refuseVersion1(const std::string& path) {
    return fail(ErrorKind::input, "is glTF 1.0, 2.0 is read", path, "convert it, e.g. with gltf-pipeline");
}

Result<void> readBinaryForm(const ByteSource& file, Container& c, uint64_t memoryBytes, Want want) {
    const auto bad = [&](const std::string& what) {
        return fail(ErrorKind::input, what, c.path, "the .glb file is damaged");
    };
    const uint64_t bytes = c.fileBytes;
    if (bytes < 12) return bad(fmt::format("has {} bytes, a .glb header has 12", bytes));
    STIPPLE_ASSIGN(const auto head, wordsAt<3>(file, 0));
    if (head[1] == 1) return refuseVersion1(c.path);
    if (head[1] != 2) return bad(fmt::format("has .glb version {}, expected 2", head[1]));
    uint64_t length = head[2];
    if (length > bytes) {  // all the same if the chunks are whole
        c.oddities.push_back(fmt::format("says it has {} bytes, but has {}", length, bytes));
        length = bytes;
    }
    if (length < 20) return bad(fmt::format("has {} bytes, too few for a chunk", length));
    c.isBinary = true;
    bool hasJson = false;
    uint64_t at = 12;
    for (int chunk = 0; at < length; ++chunk) {  // what follows is not part of it
        if (length - at < 8) return bad(fmt::format("ends within the head of chunk {} at offset {}", chunk, at));
        STIPPLE_ASSIGN(const auto chunkHead, wordsAt<2>(file, at));
        const auto [size, type] = chunkHead;
        if (size % 4 != 0)
            c.oddities.push_back(
                fmt::format("chunk {} at offset {} has {} bytes, not a multiple of 4", chunk, at, size));
        if (size > bytes - at - 8)
            return bad(
                fmt::format("chunk {} at offset {} has {} bytes, only {} are left", chunk, at, size, bytes - at - 8));
        if (size > length - at - 8) {
            c.oddities.push_back(fmt::format("says it has {} bytes, but chunk {} ends later", length, chunk));
            length = at + 8 + size;
        }
        if (chunk == 0 && type != kJsonChunk)
            return bad(fmt::format("the first chunk has type {:#x}, expected JSON", type));
        if (chunk > 0 && type == kJsonChunk)
            return bad(fmt::format("chunk {} at offset {} is a second JSON chunk", chunk, at));
        if (type == kBinaryChunk && c.hasBinaryChunk) {
            c.oddities.push_back(fmt::format("chunk {} at offset {} is a second binary chunk", chunk, at));
            at += 8 + uint64_t{size};
            continue;
        }
        if (type == kBinaryChunk && chunk != 1)
            c.oddities.push_back(
                fmt::format("chunk {} at offset {} is a binary chunk, which must be the second", chunk, at));
        if (size == 0 && type != kBinaryChunk) return bad(fmt::format("chunk {} at offset {} is empty", chunk, at));
        if (type == kJsonChunk) {
            std::vector<char> text(size);
            STIPPLE_TRY(file.readAt(at + 8, text.data(), size));
            STIPPLE_ASSIGN(c.json, parseJson(text.data(), text.data() + size, c, memoryBytes));
            hasJson = true;
        } else if (type == kBinaryChunk) {
            c.hasBinaryChunk = true;
            if (want == Want::all) {
                resizeHuge(c.binary, size);
                STIPPLE_TRY(file.readAt(at + 8, c.binary.data(), size));
            }
        }
        at += 8 + uint64_t{size};
    }
    return hasJson ? Result<void>() : bad("holds no JSON chunk");
}

}  // namespace

Result<Container> readContainer(const std::string& path, uint64_t memoryBytes, Want want) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    return readContainer(file, memoryBytes, want);
}

Result<Container> readContainer(const ByteSource& file, uint64_t memoryBytes, Want want) {
    const std::string& path = file.path();
    Container c;
    c.path = path;
    c.folder = std::filesystem::path(path).parent_path().string();
    c.fileBytes = file.sizeBytes();
    if (want == Want::all && 2 * c.fileBytes > memoryBytes)  // its chunks, and what is made of them
        return overBudget("is read as a whole, which", 2 * c.fileBytes, memoryBytes, path);
    if (c.fileBytes == 0) return fail(ErrorKind::input, "is empty", path, "is the download complete?");
    const bool isNamedBinary = std::filesystem::path(path).extension() == ".glb";
    if (c.fileBytes >= 4) {
        STIPPLE_ASSIGN(const auto first, wordsAt<1>(file, 0));
        if (std::memcmp(first.data(), "glTF", 4) == 0) {
            STIPPLE_TRY(readBinaryForm(file, c, memoryBytes, want));
            return c;
        }
    }
    if (isNamedBinary) return fail(ErrorKind::input, "does not begin with glTF", path, "is it a .glb file?");
    if (2 * c.fileBytes > memoryBytes)
        return overBudget("is read as a whole, which", 2 * c.fileBytes, memoryBytes, path);
    std::vector<char> text(c.fileBytes);
    STIPPLE_TRY(file.readAt(0, text.data(), text.size()));
    STIPPLE_ASSIGN(c.json, parseJson(text.data(), text.data() + text.size(), c, memoryBytes));
    // Its lists are objects, by names.
    if (const auto lists = c.json.find("accessors"); lists != c.json.end() && lists->is_object())
        return refuseVersion1(path);
    return c;
}

}  // namespace stipple::scene::gltf
