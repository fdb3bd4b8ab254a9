#include "lod/import/ply/header.h"

#include <fmt/format.h>

#include <charconv>
#include <sstream>

#include "engine/base/text.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kHeaderLimit = 1 << 20;

bool parseType(const std::string& name, PlyType& type) {
    static const std::array<std::array<const char*, 2>, 8> names{{{"char", "int8"},
                                                                  {"uchar", "uint8"},
                                                                  {"short", "int16"},
                                                                  {"ushort", "uint16"},
                                                                  {"int", "int32"},
                                                                  {"uint", "uint32"},
                                                                  {"float", "float32"},
                                                                  {"double", "float64"}}};
    for (size_t i = 0; i < names.size(); ++i)
        if (name == names.at(i)[0] || name == names.at(i)[1]) {
            type = static_cast<PlyType>(i);
            return true;
        }
    return false;
}

PlyRole parseRole(const std::string& name) {
    static const std::array<std::pair<const char*, PlyRole>, 23> names{{{"x", PlyRole::x},
                                                                        {"y", PlyRole::y},
                                                                        {"z", PlyRole::z},
                                                                        {"nx", PlyRole::nx},
                                                                        {"ny", PlyRole::ny},
                                                                        {"nz", PlyRole::nz},
                                                                        {"normal_x", PlyRole::nx},
                                                                        {"normal_y", PlyRole::ny},
                                                                        {"normal_z", PlyRole::nz},
                                                                        {"red", PlyRole::red},
                                                                        {"green", PlyRole::green},
                                                                        {"blue", PlyRole::blue},
                                                                        {"r", PlyRole::red},
                                                                        {"g", PlyRole::green},
                                                                        {"b", PlyRole::blue},
                                                                        {"diffuse_red", PlyRole::red},
                                                                        {"diffuse_green", PlyRole::green},
                                                                        {"diffuse_blue", PlyRole::blue},
                                                                        {"radius", PlyRole::radius},
                                                                        {"value", PlyRole::none},
                                                                        {"roughness", PlyRole::roughness},
                                                                        {"metallic", PlyRole::metallic},
                                                                        {"metalness", PlyRole::metallic}}};
    for (const auto& [text, role] : names)
        if (name == text) return role;
    return PlyRole::none;
}

}  // namespace

Result<PlyHeader> parsePlyHeader(const ByteSource& file) {
    const std::string& path = file.path();
    std::string text(static_cast<size_t>(std::min(file.sizeBytes(), kHeaderLimit)), '\0');
    STIPPLE_TRY(file.readAt(0, text.data(), text.size()));
    const auto bad = [&](const std::string& what, int line) {
        return fail(ErrorKind::input, what, fmt::format("{}: header line {}", path, line), "is it really a PLY file?");
    };
    PlyHeader header;
    size_t position = 0;
    bool hasFormat = false;
    for (int line = 1;; ++line) {
        const size_t end = text.find('\n', position);
        if (end == std::string::npos) return bad("the header has no end_header", line);
        std::string row = text.substr(position, end - position);
        position = end + 1;
        if (!row.empty() && row.back() == '\r') row.pop_back();
        std::istringstream words(row);
        std::string key;
        words >> key;
        if (line == 1) {
            if (key != "ply") return bad("the first line is not 'ply'", line);
        } else if (key == "end_header") {
            header.bytes = position;
            break;
        } else if (key == "format") {
            std::string name;
            words >> name;
            hasFormat = true;
            if (name == "ascii")
                header.encoding = PlyEncoding::ascii;
            else if (name == "binary_little_endian")
                header.encoding = PlyEncoding::little;
            else if (name == "binary_big_endian")
                header.encoding = PlyEncoding::big;
            else
                return bad(fmt::format("unknown format '{}'", name), line);
        } else if (key == "element") {
            PlyElement element;
            std::string count;
            words >> element.name >> count;
            const auto [last, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
            if (count.empty() || error != std::errc() || last != count.data() + count.size())
                return bad(fmt::format("'{}' is not a count", count), line);
            header.elements.push_back(std::move(element));
        } else if (key == "property") {
            if (header.elements.empty()) return bad("a property stands before any element", line);
            PlyProperty property;
            std::string type;
            words >> type;
            if (type == "list") {
                property.isList = true;
                std::string countType;
                words >> countType >> type;
                if (!parseType(countType, property.countType))
                    return bad(fmt::format("unknown type '{}'", countType), line);
            }
            if (!parseType(type, property.type)) return bad(fmt::format("unknown type '{}'", type), line);
            words >> property.name;
            property.name = printable(property.name);
            if (!property.isList) property.role = parseRole(property.name);
            property.slot = static_cast<int>(property.role);
            header.elements.back().properties.push_back(std::move(property));
        } else if (key != "comment" && key != "obj_info" && !key.empty()) {
            // Real scanners write more than the format knows; only what lies between an element and its properties
            // could mean them.
            if (!header.elements.empty()) return bad(fmt::format("unknown keyword '{}'", key), line);
            ++header.unknownLines;
        }
    }
    if (!hasFormat) return bad("the header has no format line", 2);
    return header;
}

}  // namespace stipple::lod
