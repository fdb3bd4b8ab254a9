#include "lod/import/ply/rows.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "engine/base/numbers.h"
#include "engine/base/process.h"

namespace stipple::lod {
namespace {

constexpr size_t kMostCorners = 65536;  ///< of a list at once

double decode(const uint8_t* bytes, PlyType type, bool swap) {
    const size_t size = kPlyTypeBytes.at(static_cast<size_t>(type));
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
        case PlyType::i8:
            return as(int8_t{});
        case PlyType::u8:
            return as(uint8_t{});
        case PlyType::i16:
            return as(int16_t{});
        case PlyType::u16:
            return as(uint16_t{});
        case PlyType::i32:
            return as(int32_t{});
        case PlyType::u32:
            return as(uint32_t{});
        case PlyType::f32:
            return as(float{});
        case PlyType::f64:
            return as(double{});
    }
    return 0;
}

bool isColour(PlyRole role) { return role == PlyRole::red || role == PlyRole::green || role == PlyRole::blue; }
/// The type of the colours (of the widest channel), if they have three channels.
std::optional<PlyType> colourTypeOf(const PlyHeader& header) {
    std::optional<PlyType> widest;
    int channels = 0;
    for (const PlyElement& e : header.elements)
        for (const PlyProperty& p : e.properties)
            if (e.name == "vertex" && isColour(p.role)) {
                widest = std::max(widest.value_or(p.type), p.type);
                ++channels;
            }
    return channels == 3 ? widest : std::nullopt;
}

/// What stands for 1 where a property is a share.
double largestOf(PlyType type) {
    switch (type) {
        case PlyType::i8:
            return 127;
        case PlyType::u8:
            return 255;
        case PlyType::i16:
            return 32767;
        case PlyType::u16:
            return 65535;
        case PlyType::i32:
            return 2147483647;
        case PlyType::u32:
            return 4294967295.0;
        default:
            return 1;
    }
}

/// Lengths of normals do not matter: what is no float keeps its direction.
glm::vec3 normalOf(const glm::dvec3& n) {
    const double largest = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
    const bool isFar = hasDirection(n) && !(largest > 1e-30 && largest < 1e30);
    const glm::dvec3 v = isFar ? withoutScale(n) : n;
    return {toFloat(v.x), toFloat(v.y), toFloat(v.z)};
}

}  // namespace

double plyColourScale(PlyType type, double largest) {
    if (type < PlyType::i16) return 1;
    if (type < PlyType::f32) return largest > 255 ? 1 / 257.0 : 1;
    return largest <= 2 ? 255 : largest <= 510 ? 1 : 1 / 257.0;
}

double PlyReader::colourScaleOf(const std::shared_ptr<const ByteSource>& file, const PlyHeader& header) {
    const std::optional<PlyType> type = colourTypeOf(header);
    if (!type || *type < PlyType::i16) return 1;
    PlyReader reader(file, header, 0);
    double largest = 0;
    if (reader.begin())
        for (uint64_t row = 0; row < reader.vertex_->count && largest <= 510; ++row) {
            std::array<double, kPlyRoles + kMostAttributes> v{};
            if (row % 65536 == 0 && isStopRequested()) break;
            if (!reader.readRow(*reader.vertex_, v.data())) break;
            for (const PlyRole role : {PlyRole::red, PlyRole::green, PlyRole::blue})
                if (const double c = v.at(static_cast<size_t>(role)); c <= 65536) largest = std::max(largest, c);
        }
    return plyColourScale(*type, largest);
}

PlyReader::PlyReader(std::shared_ptr<const ByteSource> file, PlyHeader header, size_t wanted, double colourScale)
    : file_(file),
      header_(std::move(header)),
      cursor_(std::move(file), header_.bytes),
      wanted_(wanted),
      colourScale_(colourScale) {
    for (const PlyElement& e : header_.elements)
        if (e.name == "vertex")
            for (const PlyProperty& p : e.properties)
                if (p.slot >= static_cast<int>(kPlyRoles))
                    attributes_.emplace_back(static_cast<size_t>(p.slot), isWide(p.type));
}

/// To the first vertex.
Result<void> PlyReader::begin() {
    if (started_) return {};
    started_ = true;
    for (const PlyElement& element : header_.elements) {
        if (element.name == "vertex") {
            vertex_ = &element;
            break;
        }
        for (uint64_t row = 0; row < element.count; ++row) STIPPLE_TRY(readRow(element, nullptr));
    }
    return {};
}

Result<size_t> PlyReader::read(PointBlock& block, size_t limit) {
    STIPPLE_TRY(begin());
    const auto count = static_cast<size_t>(std::min<uint64_t>({limit, vertex_->count - next_, 65536}));
    std::array<bool, kPlyRoles> has{};
    std::array<double, kPlyRoles> most{};
    most.fill(1);
    for (const PlyProperty& p : vertex_->properties)
        if (p.role != PlyRole::none) {
            has.at(static_cast<size_t>(p.role)) = true;
            most.at(static_cast<size_t>(p.role)) = largestOf(p.type);
        }
    block.position.reserve(count);
    block.attributes.resize(wanted_);
    for (size_t i = 0; i < count; ++i) {
        std::array<double, kPlyRoles + kMostAttributes> v{};
        STIPPLE_TRY(readRow(*vertex_, v.data()));
        block.position.emplace_back(v[0], v[1], v[2]);
        if (has[3] && has[4] && has[5]) block.normal.push_back(normalOf({v[3], v[4], v[5]}));
        if (has[6] && has[7] && has[8]) {
            const auto channel = [&](double c) {
                return toWhole<uint32_t>(std::clamp(c * colourScale_ + 0.5, 0.0, 255.0));
            };
            block.colour.push_back(channel(v[6]) | channel(v[7]) << 8 | channel(v[8]) << 16);
        }
        if (has[9]) block.radius.push_back(toFloat(v[9]));
        if (has[10] || has[11]) block.material.push_back(gridIndex(has[10] ? v[10] / most[10] : 1, v[11] / most[11]));
        for (const auto& [slot, wide] : attributes_) {
            auto& values = block.attributes[slot - kPlyRoles];
            const float narrow = toFloat(v.at(slot));
            const auto* bytes =
                wide ? reinterpret_cast<const uint8_t*>(&v.at(slot)) : reinterpret_cast<const uint8_t*>(&narrow);
            values.insert(values.end(), bytes, bytes + (wide ? 8 : 4));
        }
    }
    next_ += count;
    return count;
}

Result<void> PlyReader::flushCorners(bool areTriangles) {
    STIPPLE_TRY((*take_)({isStrip_, isFirst_, areTriangles, list_}));
    isFirst_ = false;
    list_.clear();
    return {};
}

/// Rows of three corners, as most files hold them and nothing else: as many as stand here one after the other and fit
/// in a block. Of all others, and at the end of a file that is too short: none.
Result<uint64_t> PlyReader::readTriangles(const PlyElement& element, uint64_t most) {
    constexpr uint64_t kRowBytes = 1 + 3 * 4, kRows = 4096;
    const bool isPlain = header_.encoding == PlyEncoding::little && cornerList_ != nullptr && !isStrip_ &&
                         element.properties.size() == 1 && cornerList_->countType <= PlyType::u8 &&
                         (cornerList_->type == PlyType::i32 || cornerList_->type == PlyType::u32);
    if (!isPlain) return 0;
    size_t available = 0;
    STIPPLE_ASSIGN(const uint8_t* const bytes, cursor_.peek(std::min(most, kRows) * kRowBytes, available));
    const uint64_t rows = std::min({most, kRows, available / kRowBytes});
    const bool isSigned = cornerList_->type == PlyType::i32;
    uint64_t triangles = 0;
    while (triangles < rows && bytes[triangles * kRowBytes] == 3) ++triangles;
    list_.resize(3 * triangles);
    for (uint64_t i = 0; i < list_.size(); ++i) {
        uint32_t corner = 0;
        std::memcpy(&corner, bytes + i / 3 * kRowBytes + 1 + 4 * (i % 3), 4);
        list_[i] = isSigned ? static_cast<double>(static_cast<int32_t>(corner)) : corner;
    }
    cursor_.skip(triangles * kRowBytes);
    return triangles;
}

Result<void> PlyReader::readCorners(uint64_t offset, const std::function<Result<void>(const Corners&)>& take) {
    cursor_ = Cursor(file_, offset);
    take_ = &take;
    const auto vertex = std::find_if(header_.elements.begin(), header_.elements.end(),
                                     [](const PlyElement& e) { return e.name == "vertex"; });
    for (auto element = vertex; element != header_.elements.end(); ++element) {
        if (element == vertex) continue;
        const auto list = std::find_if(element->properties.begin(), element->properties.end(), isCornerList);
        cornerList_ = list == element->properties.end() ? nullptr : &*list;
        isStrip_ = element->name == "tristrips";
        rowsOf_ = &*element;
        for (uint64_t& r = row_ = 0; r < element->count; ++r) {
            list_.clear();
            isFirst_ = true;
            STIPPLE_ASSIGN(const uint64_t triangles, readTriangles(*element, element->count - r));
            if (triangles > 0) {
                STIPPLE_TRY(flushCorners(true));
                r += triangles - 1;
                continue;
            }
            STIPPLE_TRY(readRow(*element, nullptr));
            if (cornerList_) STIPPLE_TRY(flushCorners());
        }
    }
    cornerList_ = nullptr;
    rowsOf_ = nullptr;
    return {};
}

tl::unexpected<Error> PlyReader::truncated() const {
    const std::string where = rowsOf_   ? fmt::format("within element '{}', at row {}", rowsOf_->name, row_)
                              : vertex_ ? fmt::format("within element 'vertex', at vertex {}", next_)
                                        : "before element 'vertex'";
    return fail(ErrorKind::input, "ends " + where, file_->path(), "the file is truncated or its header lies");
}

Result<void> PlyReader::readRow(const PlyElement& element, double* values) {
    if (header_.encoding == PlyEncoding::ascii) return readAsciiRow(element, values);
    const bool swap = header_.encoding == PlyEncoding::big;
    for (const PlyProperty& p : element.properties) {
        const size_t size = kPlyTypeBytes.at(static_cast<size_t>(p.type));
        size_t available = 0;
        if (p.isList) {
            const size_t countSize = kPlyTypeBytes.at(static_cast<size_t>(p.countType));
            STIPPLE_ASSIGN(const uint8_t* bytes, cursor_.peek(countSize, available));
            if (available < countSize) return truncated();
            const double count = decode(bytes, p.countType, swap);
            cursor_.skip(countSize);
            if (!(count >= 0) || count * static_cast<double>(size) > static_cast<double>(cursor_.remaining()))
                return truncated();
            if (&p == cornerList_) {
                for (auto left = static_cast<size_t>(count); left > 0;) {
                    const size_t now = std::min(left, kMostCorners);
                    STIPPLE_ASSIGN(bytes, cursor_.peek(now * size, available));
                    if (available < now * size) return truncated();
                    for (size_t i = 0; i < now; ++i) list_.push_back(decode(bytes + i * size, p.type, swap));
                    cursor_.skip(now * size);
                    left -= now;
                    if (left > 0) STIPPLE_TRY(flushCorners());
                }
                continue;
            }
            for (auto left = static_cast<size_t>(count) * size; left > 0;) {
                STIPPLE_ASSIGN(bytes, cursor_.peek(std::min(left, kPlyBlockBytes), available));
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

Result<void> PlyReader::readAsciiRow(const PlyElement& element, double* values) {
    size_t available = 0;
    const uint8_t* bytes = nullptr;
    size_t end = 0;
    for (;;) {  // a line, blank ones skipped
        STIPPLE_ASSIGN(bytes, cursor_.peek(4096, available));
        const void* found = std::memchr(bytes, '\n', available);
        if (!found && available == 0) return truncated();
        if (!found && cursor_.remaining() > available) {
            STIPPLE_ASSIGN(bytes, cursor_.peek(kPlyBlockBytes, available));
            found = std::memchr(bytes, '\n', available);
            if (!found && cursor_.remaining() > available)
                return fail(ErrorKind::input, "a line is longer than 4 MiB", file_->path(), "is it really ascii PLY?");
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
    for (const PlyProperty& p : element.properties) {
        double value = 0;
        if (!number(value)) return badNumber(element);
        if (p.isList) {
            if (!(value >= 0 && value <= 4294967295.0)) return badNumber(element);
            for (auto left = static_cast<uint32_t>(value); left > 0; --left) {
                if (!number(value)) return badNumber(element);
                if (&p == cornerList_) list_.push_back(value);
            }
        } else if (values && p.slot >= 0) {
            values[static_cast<size_t>(p.slot)] = value;
        }
    }
    cursor_.skip(std::min(end + 1, available));
    return {};
}

tl::unexpected<Error> PlyReader::badNumber(const PlyElement& element) const {
    return fail(ErrorKind::input,
                fmt::format("a row of element '{}' near byte {} (vertex {}) has too few numbers or is not a number",
                            element.name, cursor_.offset(), next_),
                file_->path(), "the file is truncated or damaged");
}

}  // namespace stipple::lod
