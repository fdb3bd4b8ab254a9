// PLY, all three encodings. A property of any type may feed x y z nx ny nz red green blue radius; what is not known is
// stepped over, lists included. Read in blocks; a header that promises more than the file can hold is refused.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <memory>
#include <sstream>

#include "engine/base/file.h"
#include "lod/import/import.h"
#include "lod/import/ply_mesh.h"

namespace stipple::lod {
namespace {

enum class Type : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::array<uint8_t, 8> kTypeBytes{1, 1, 2, 2, 4, 4, 4, 8};
enum class Role : int8_t { none = -1, x, y, z, nx, ny, nz, red, green, blue, radius };
constexpr size_t kRoles = 10;
constexpr size_t kMostAttributes = 64;
constexpr uint64_t kHeaderLimit = 1 << 20;
constexpr size_t kBlockBytes = size_t{4} << 20;

struct Property {
    std::string name;
    Type type = Type::f32, countType = Type::u8;
    bool isList = false;
    Role role = Role::none;
    int slot = -1;  ///< of the values that a row gives: by role, then the attributes asked for; -1: not wanted
};
struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
    bool hasLists() const {
        return std::any_of(properties.begin(), properties.end(), [](const Property& p) { return p.isList; });
    }
    size_t rowBytes() const {
        size_t sum = 0;
        for (const Property& p : properties) sum += kTypeBytes.at(static_cast<size_t>(p.type));
        return sum;
    }
};
enum class Encoding { ascii, little, big };

struct Header {
    Encoding encoding = Encoding::ascii;
    std::vector<Element> elements;
    uint64_t bytes = 0;
};

bool parseType(const std::string& name, Type& type) {
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
            type = static_cast<Type>(i);
            return true;
        }
    return false;
}

Role parseRole(const std::string& name) {
    static const std::array<std::pair<const char*, Role>, 20> names{{{"x", Role::x},
                                                                     {"y", Role::y},
                                                                     {"z", Role::z},
                                                                     {"nx", Role::nx},
                                                                     {"ny", Role::ny},
                                                                     {"nz", Role::nz},
                                                                     {"normal_x", Role::nx},
                                                                     {"normal_y", Role::ny},
                                                                     {"normal_z", Role::nz},
                                                                     {"red", Role::red},
                                                                     {"green", Role::green},
                                                                     {"blue", Role::blue},
                                                                     {"r", Role::red},
                                                                     {"g", Role::green},
                                                                     {"b", Role::blue},
                                                                     {"diffuse_red", Role::red},
                                                                     {"diffuse_green", Role::green},
                                                                     {"diffuse_blue", Role::blue},
                                                                     {"radius", Role::radius},
                                                                     {"value", Role::none}}};
    for (const auto& [text, role] : names)
        if (name == text) return role;
    return Role::none;
}

Result<Header> parseHeader(const InputFile& file) {
    const std::string& path = file.path();
    std::string text(static_cast<size_t>(std::min(file.sizeBytes(), kHeaderLimit)), '\0');
    STIPPLE_TRY(file.readAt(0, text.data(), text.size()));
    const auto bad = [&](const std::string& what, int line) {
        return fail(ErrorKind::input, what, fmt::format("{}: header line {}", path, line), "is it really a PLY file?");
    };
    Header header;
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
                header.encoding = Encoding::ascii;
            else if (name == "binary_little_endian")
                header.encoding = Encoding::little;
            else if (name == "binary_big_endian")
                header.encoding = Encoding::big;
            else
                return bad(fmt::format("unknown format '{}'", name), line);
        } else if (key == "element") {
            Element element;
            std::string count;
            words >> element.name >> count;
            const auto [last, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
            if (count.empty() || error != std::errc() || last != count.data() + count.size())
                return bad(fmt::format("'{}' is not a count", count), line);
            header.elements.push_back(std::move(element));
        } else if (key == "property") {
            if (header.elements.empty()) return bad("a property stands before any element", line);
            Property property;
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
            if (!property.isList) property.role = parseRole(property.name);
            property.slot = static_cast<int>(property.role);
            header.elements.back().properties.push_back(std::move(property));
        } else if (key != "comment" && key != "obj_info" && !key.empty()) {
            return bad(fmt::format("unknown keyword '{}'", key), line);
        }
    }
    if (!hasFormat) return bad("the header has no format line", 2);
    return header;
}

/// A forward reader over the file in blocks.
class Cursor {
  public:
    Cursor(std::shared_ptr<const InputFile> file, uint64_t offset) : file_(std::move(file)), offset_(offset) {}
    uint64_t remaining() const { return file_->sizeBytes() - offset_ + (buffer_.size() - used_); }
    uint64_t offset() const { return offset_ - (buffer_.size() - used_); }
    /// Makes at least `count` bytes (or all that are left) available; returns a pointer to them.
    Result<const uint8_t*> peek(size_t count, size_t& available) {
        if (buffer_.size() - used_ < count) {
            buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(used_));
            used_ = 0;
            const size_t want = std::max(count, kBlockBytes) - buffer_.size();
            const auto get = static_cast<size_t>(std::min<uint64_t>(want, file_->sizeBytes() - offset_));
            const size_t old = buffer_.size();
            buffer_.resize(old + get);
            STIPPLE_TRY(file_->readAt(offset_, buffer_.data() + old, get));
            offset_ += get;
        }
        available = buffer_.size() - used_;
        return buffer_.data() + used_;
    }
    void skip(size_t count) { used_ += count; }

  private:
    std::shared_ptr<const InputFile> file_;
    uint64_t offset_;
    size_t used_ = 0;
    std::vector<uint8_t> buffer_;
};

double decode(const uint8_t* bytes, Type type, bool swap) {
    const size_t size = kTypeBytes.at(static_cast<size_t>(type));
    std::array<uint8_t, 8> raw{};
    if (swap)
        std::reverse_copy(bytes, bytes + size, raw.begin());
    else
        std::copy_n(bytes, size, raw.begin());
    const auto as = [&](auto value) {
        std::memcpy(&value, raw.data(), sizeof(value));
        return static_cast<double>(value);
    };
    switch (type) {
        case Type::i8:
            return as(int8_t{});
        case Type::u8:
            return as(uint8_t{});
        case Type::i16:
            return as(int16_t{});
        case Type::u16:
            return as(uint16_t{});
        case Type::i32:
            return as(int32_t{});
        case Type::u32:
            return as(uint32_t{});
        case Type::f32:
            return as(float{});
        case Type::f64:
            return as(double{});
    }
    return 0;
}

/// Attributes are kept as f32 where that is exact, as f64 otherwise.
bool isWide(Type type) { return type == Type::f64 || type == Type::i32 || type == Type::u32; }

class PlyReader {
  public:
    PlyReader(std::shared_ptr<const InputFile> file, Header header, size_t wanted)
        : file_(file), header_(std::move(header)), cursor_(std::move(file), header_.bytes), wanted_(wanted) {
        for (const Element& e : header_.elements)
            if (e.name == "vertex")
                for (const Property& p : e.properties)
                    if (p.slot >= static_cast<int>(kRoles))
                        attributes_.emplace_back(static_cast<size_t>(p.slot), isWide(p.type));
    }

    Result<size_t> read(PointBlock& block, size_t limit) {
        if (!started_) {
            started_ = true;
            for (const Element& element : header_.elements) {
                if (element.name == "vertex") {
                    vertex_ = &element;
                    break;
                }
                for (uint64_t row = 0; row < element.count; ++row) STIPPLE_TRY(readRow(element, nullptr));
            }
        }
        const auto count = static_cast<size_t>(std::min<uint64_t>({limit, vertex_->count - next_, 65536}));
        std::array<bool, kRoles> has{};
        double colourScale = 1;
        for (const Property& p : vertex_->properties) {
            if (p.role == Role::none) continue;
            has.at(static_cast<size_t>(p.role)) = true;
            if (p.role == Role::red)
                colourScale = p.type == Type::f32 || p.type == Type::f64 ? 255.0
                              : p.type == Type::u16                      ? 1 / 257.0
                                                                         : 1.0;
        }
        block.position.reserve(count);
        block.attributes.resize(wanted_);
        for (size_t i = 0; i < count; ++i) {
            std::array<double, kRoles + kMostAttributes> v{};
            STIPPLE_TRY(readRow(*vertex_, v.data()));
            block.position.emplace_back(v[0], v[1], v[2]);
            if (has[3] && has[4] && has[5])
                block.normal.emplace_back(static_cast<float>(v[3]), static_cast<float>(v[4]), static_cast<float>(v[5]));
            if (has[6] && has[7] && has[8]) {
                const auto channel = [&](double c) {
                    return static_cast<uint32_t>(std::clamp(c * colourScale + 0.5, 0.0, 255.0));
                };
                block.colour.push_back(channel(v[6]) | channel(v[7]) << 8 | channel(v[8]) << 16);
            }
            if (has[9]) block.radius.push_back(static_cast<float>(v[9]));
            for (const auto& [slot, wide] : attributes_) {
                auto& values = block.attributes[slot - kRoles];
                const auto narrow = static_cast<float>(v.at(slot));
                const auto* bytes =
                    wide ? reinterpret_cast<const uint8_t*>(&v.at(slot)) : reinterpret_cast<const uint8_t*>(&narrow);
                values.insert(values.end(), bytes, bytes + (wide ? 8 : 4));
            }
        }
        next_ += count;
        return count;
    }

    /// Calls face(corners) for each row of the elements after the vertices that have a list of that name.
    template <typename Face>
    Result<void> readLists(const Face& face) {
        bool isAfter = false;
        for (const Element& element : header_.elements) {
            if (isAfter) {
                const auto list = std::find_if(element.properties.begin(), element.properties.end(), isCornerList);
                wantedList_ = list == element.properties.end() ? nullptr : &*list;
                for (uint64_t row = 0; row < element.count; ++row) {
                    list_.clear();
                    STIPPLE_TRY(readRow(element, nullptr));
                    if (wantedList_) STIPPLE_TRY(face(element.name == "tristrips", list_));
                }
            }
            isAfter = isAfter || &element == vertex_;
        }
        wantedList_ = nullptr;
        return {};
    }
    static bool isCornerList(const Property& p) {
        return p.isList && (p.name == "vertex_indices" || p.name == "vertex_index");
    }

  private:
    tl::unexpected<Error> truncated() const {
        return fail(ErrorKind::input,
                    fmt::format("ends within element '{}', at vertex {}", vertex_ ? "vertex" : "before vertex", next_),
                    file_->path(), "the file is truncated or its header lies");
    }

    /// Reads one row; `values` (by role) may be null.
    Result<void> readRow(const Element& element, double* values) {
        if (header_.encoding == Encoding::ascii) return readAsciiRow(element, values);
        const bool swap = header_.encoding == Encoding::big;
        for (const Property& p : element.properties) {
            const size_t size = kTypeBytes.at(static_cast<size_t>(p.type));
            size_t available = 0;
            if (p.isList) {
                const size_t countSize = kTypeBytes.at(static_cast<size_t>(p.countType));
                STIPPLE_ASSIGN(const uint8_t* bytes, cursor_.peek(countSize, available));
                if (available < countSize) return truncated();
                const double count = decode(bytes, p.countType, swap);
                cursor_.skip(countSize);
                if (!(count >= 0) || count * static_cast<double>(size) > static_cast<double>(cursor_.remaining()))
                    return truncated();
                if (&p == wantedList_) {
                    const size_t bytesWanted = static_cast<size_t>(count) * size;
                    STIPPLE_ASSIGN(bytes, cursor_.peek(bytesWanted, available));
                    if (available < bytesWanted) return truncated();
                    for (size_t i = 0; i < static_cast<size_t>(count); ++i)
                        list_.push_back(decode(bytes + i * size, p.type, swap));
                    cursor_.skip(bytesWanted);
                    continue;
                }
                for (auto left = static_cast<size_t>(count) * size; left > 0;) {
                    STIPPLE_ASSIGN(bytes, cursor_.peek(std::min(left, kBlockBytes), available));
                    if (available == 0) return truncated();
                    cursor_.skip(std::min(left, available));
                    left -= std::min(left, available);
                }
                continue;
            }
            STIPPLE_ASSIGN(const uint8_t* bytes, cursor_.peek(size, available));
            if (available < size) return truncated();
            if (values && p.slot >= 0) values[static_cast<size_t>(p.slot)] = decode(bytes, p.type, swap);
            cursor_.skip(size);
        }
        return {};
    }

    Result<void> readAsciiRow(const Element& element, double* values) {
        size_t available = 0;
        const uint8_t* bytes = nullptr;
        size_t end = 0;
        for (;;) {  // a line, blank ones skipped
            STIPPLE_ASSIGN(bytes, cursor_.peek(4096, available));
            const void* found = std::memchr(bytes, '\n', available);
            if (!found && available == 0) return truncated();
            if (!found && cursor_.remaining() > available) {
                STIPPLE_ASSIGN(bytes, cursor_.peek(kBlockBytes, available));
                found = std::memchr(bytes, '\n', available);
                if (!found && cursor_.remaining() > available)
                    return fail(ErrorKind::input, "a line is longer than 4 MiB", file_->path(),
                                "is it really ascii PLY?");
            }
            end = found ? static_cast<size_t>(static_cast<const uint8_t*>(found) - bytes) : available;
            const bool blank =
                std::all_of(bytes, bytes + end, [](uint8_t c) { return c == ' ' || c == '\r' || c == '\t'; });
            if (!blank) break;
            cursor_.skip(std::min(end + 1, available));
        }
        const char* at = reinterpret_cast<const char*>(bytes);
        const char* last = at + end;
        const auto number = [&](double& value) {
            while (at < last && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
            if (at < last && *at == '+') ++at;
            const auto [next, error] = std::from_chars(at, last, value);
            if (error == std::errc::result_out_of_range)
                value = std::numeric_limits<double>::quiet_NaN();
            else if (error != std::errc())
                return false;
            at = next;
            return true;
        };
        for (const Property& p : element.properties) {
            double value = 0;
            if (!number(value)) return badNumber(element);
            if (p.isList) {
                if (!(value >= 0 && value <= 4294967295.0)) return badNumber(element);
                for (auto left = static_cast<uint32_t>(value); left > 0; --left) {
                    if (!number(value)) return badNumber(element);
                    if (&p == wantedList_) list_.push_back(value);
                }
            } else if (values && p.slot >= 0) {
                values[static_cast<size_t>(p.slot)] = value;
            }
        }
        cursor_.skip(std::min(end + 1, available));
        return {};
    }

    tl::unexpected<Error> badNumber(const Element& element) const {
        return fail(ErrorKind::input,
                    fmt::format("a row of element '{}' near byte {} (vertex {}) has too few numbers or is not a number",
                                element.name, cursor_.offset(), next_),
                    file_->path(), "the file is truncated or damaged");
    }

    std::shared_ptr<const InputFile> file_;
    Header header_;
    Cursor cursor_;
    size_t wanted_;
    std::vector<std::pair<size_t, bool>> attributes_;  ///< slot, stored as f64
    const Element* vertex_ = nullptr;
    const Property* wantedList_ = nullptr;
    std::vector<double> list_;
    uint64_t next_ = 0;
    bool started_ = false;
};

/// Faces as fans, strips unrolled; corners that are no vertex are counted and left out.
class FaceTaker {
  public:
    FaceTaker(TriangleMesh& mesh, PlyMeshNotes& notes) : mesh_(mesh), notes_(notes) {}
    void take(bool isStrip, const std::vector<double>& list) {
        if (isStrip) return strip(list);
        for (size_t i = 2; i < list.size(); ++i) triangle(list[0], list[i - 1], list[i]);
    }

  private:
    void strip(const std::vector<double>& list) {
        size_t first = 0;
        for (size_t i = 0; i < list.size(); ++i) {
            if (list[i] < 0) {  // -1 starts a new one
                first = i + 1;
                continue;
            }
            if (i < first + 2) continue;
            const bool isOdd = (i - first) % 2 == 1;
            triangle(list[i - 2], list[isOdd ? i : i - 1], list[isOdd ? i - 1 : i]);
        }
    }
    void triangle(double a, double b, double c) {
        const auto count = static_cast<double>(mesh_.position.size());
        for (const double v : {a, b, c})
            if (!(v >= 0 && v < count)) {
                ++notes_.badFaces;
                return;
            }
        for (const double v : {a, b, c}) mesh_.indices.push_back(static_cast<uint32_t>(v));
    }
    TriangleMesh& mesh_;
    PlyMeshNotes& notes_;
};

}  // namespace

Result<bool> hasPlyFaces(const std::string& path) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    std::array<char, 3> magic{};
    if (file.sizeBytes() < 4) return false;
    STIPPLE_TRY(file.readAt(0, magic.data(), magic.size()));
    if (magic != std::array<char, 3>{'p', 'l', 'y'}) return false;
    STIPPLE_ASSIGN(const Header header, parseHeader(file));
    return std::any_of(header.elements.begin(), header.elements.end(), [](const Element& e) {
        return e.name != "vertex" && e.count > 0 &&
               std::any_of(e.properties.begin(), e.properties.end(), PlyReader::isCornerList);
    });
}

Result<TriangleMesh> readPlyMesh(const std::string& path, PlyMeshNotes& notes) {
    // The same checks as for points; then once more from the start, faces included.
    STIPPLE_ASSIGN(const PointSource source, openPly(path, {}));
    STIPPLE_ASSIGN(InputFile opened, InputFile::open(path));
    auto file = std::make_shared<const InputFile>(std::move(opened));
    STIPPLE_ASSIGN(Header header, parseHeader(*file));
    PlyReader reader(file, std::move(header), 0);
    TriangleMesh mesh;
    PointBlock block;
    for (;;) {
        block.clear();
        STIPPLE_ASSIGN(const size_t got, reader.read(block, 65536));
        if (got == 0) break;
        mesh.position.insert(mesh.position.end(), block.position.begin(), block.position.end());
        mesh.normal.insert(mesh.normal.end(), block.normal.begin(), block.normal.end());
        for (const uint32_t c : block.colour) mesh.colour.push_back(c | 0xff000000u);
    }
    FaceTaker faces(mesh, notes);
    STIPPLE_TRY(reader.readLists([&](bool isStrip, const std::vector<double>& list) -> Result<void> {
        faces.take(isStrip, list);
        return {};
    }));
    // Which side is out is not known to many programs that write PLY.
    mesh.surface.assign(mesh.position.size(), shared::kSurfaceTwoSided);
    if (mesh.normal.empty() && !mesh.indices.empty()) smoothNormals(mesh);
    return mesh;
}

Result<PointSource> openPly(const std::string& path, const ReadOptions& options) {
    STIPPLE_ASSIGN(InputFile opened, InputFile::open(path));
    auto file = std::make_shared<const InputFile>(std::move(opened));
    STIPPLE_ASSIGN(Header header, parseHeader(*file));
    auto vertex = std::find_if(header.elements.begin(), header.elements.end(),
                               [](const Element& e) { return e.name == "vertex"; });
    if (vertex == header.elements.end())
        return fail(ErrorKind::input, "has no element 'vertex'", path, "Stipple reads the vertices of a PLY file");
    PointSource source;
    SourceInfo& info = source.info;
    unsigned roles = 0;
    const size_t wanted = std::min(options.attributes.size(), kMostAttributes);
    for (Property& p : vertex->properties) {
        if (!p.isList && p.role == Role::none) {
            AttributeInfo attribute;
            attribute.name = p.name;
            attribute.type = isWide(p.type) ? ScalarType::f64 : ScalarType::f32;
            info.attributes.push_back(attribute);
            for (size_t k = 0; k < wanted; ++k)
                if (options.attributes[k] == p.name) p.slot = static_cast<int>(kRoles + k);
        }
        if (p.role != Role::none) roles |= 1u << static_cast<unsigned>(p.role);
        if (p.isList) info.notes.push_back(fmt::format("list property '{}' of the vertices is skipped", p.name));
    }
    if ((roles & 7u) != 7u) return fail(ErrorKind::input, "the vertices have no x, y and z", path);
    // The smallest that the declared rows can be: a promise of more is a lie, found before anything is allocated.
    const uint64_t body = file->sizeBytes() - header.bytes;
    uint64_t smallest = 0;
    for (const Element& e : header.elements) {
        uint64_t row = 0;
        for (const Property& p : e.properties)
            row += header.encoding == Encoding::ascii
                       ? 2
                       : kTypeBytes.at(static_cast<size_t>(p.isList ? p.countType : p.type));
        row = std::max<uint64_t>(row, 1);
        const bool isVertex = e.name == "vertex";
        if (header.encoding == Encoding::ascii && row > 1) --row;  // the last row may lack its end of line
        const bool impossible =
            e.count > 0 && (e.count > body || e.count > (body - std::min(body, smallest)) / row + 1);
        if (impossible)
            return fail(ErrorKind::input,
                        fmt::format("the header declares {} of element '{}', but {} bytes cannot hold them", e.count,
                                    e.name, body),
                        path, "the file is truncated or its header lies");
        smallest += row * e.count;
        if (isVertex) break;
    }
    info.path = path;
    static const std::array<const char*, 3> names{"ascii", "binary little endian", "binary big endian"};
    info.format = fmt::format("PLY {}", names.at(static_cast<size_t>(header.encoding)));
    info.points = vertex->count;
    info.hasNormal = (roles >> 3 & 7u) == 7u;
    info.hasColour = (roles >> 6 & 7u) == 7u;
    info.hasRadius = (roles >> 9 & 1u) != 0;
    info.up = UpAxis::y;
    source.parts = {info.points};
    source.openPart = [path, header, wanted](size_t) -> Result<PointReader> {
        STIPPLE_ASSIGN(InputFile again, InputFile::open(path));
        auto reader = std::make_shared<PlyReader>(std::make_shared<const InputFile>(std::move(again)), header, wanted);
        return PointReader([reader](PointBlock& block, size_t limit) { return reader->read(block, limit); });
    };
    return source;
}

}  // namespace stipple::lod
