// LAS 1.0 to 1.4 (ASPRS), uncompressed. The header is believed only as far as the size of the file bears it out.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>

#include "engine/base/file.h"
#include "lod/import/import.h"

namespace stipple::lod {
namespace {

constexpr size_t kBlockBytes = size_t{4} << 20;
/// Shortest record and byte offset of red (0: no colour) of each point format.
constexpr std::array<uint16_t, 11> kRecordBytes{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
constexpr std::array<uint16_t, 11> kColourOffset{0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

template <typename T>
T get(const std::vector<uint8_t>& bytes, size_t offset) {
    T value{};
    if (offset + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + offset, sizeof(T));
    return value;
}

struct LasReader {
    InputFile file;
    uint64_t next = 0, points = 0, dataOffset = 0;
    uint32_t recordBytes = 0, colourOffset = 0;
    std::vector<uint8_t> buffer;

    Result<size_t> read(PointBlock& block, size_t limit) {
        const auto count = static_cast<size_t>(
            std::min<uint64_t>({limit, points - next, std::max<uint64_t>(1, kBlockBytes / recordBytes)}));
        if (count == 0) return size_t{0};
        buffer.resize(count * recordBytes);
        STIPPLE_TRY(file.readAt(dataOffset + next * recordBytes, buffer.data(), buffer.size()));
        next += count;
        block.position.resize(count);
        for (size_t i = 0; i < count; ++i) {
            std::array<int32_t, 3> xyz{};
            std::memcpy(xyz.data(), buffer.data() + i * recordBytes, sizeof(xyz));
            block.position[i] = {xyz[0], xyz[1], xyz[2]};
        }
        if (colourOffset != 0) {
            block.colour16.resize(count);
            uint32_t largest = 0;
            for (size_t i = 0; i < count; ++i) {
                std::array<uint16_t, 3> rgb{};
                std::memcpy(rgb.data(), buffer.data() + i * recordBytes + colourOffset, sizeof(rgb));
                largest = std::max<uint32_t>({largest, rgb[0], rgb[1], rgb[2]});
                block.colour16[i] = rgb[0] | uint64_t{rgb[1]} << 16 | uint64_t{rgb[2]} << 32;
            }
            block.colourMax = largest;
        }
        return count;
    }
};

/// CRS text (WKT, or the GeoTIFF ascii parameters) from the variable length records; what lies is noted, not followed.
void readVlrs(const InputFile& file, uint64_t offset, uint64_t end, uint32_t declared, SourceInfo& info) {
    for (uint32_t i = 0; i < declared; ++i) {
        if (offset + 54 > end) {
            info.notes.push_back(
                fmt::format("the header declares {} variable length records, but only {} fit", declared, i));
            return;
        }
        std::vector<uint8_t> head(54);
        if (!file.readAt(offset, head.data(), head.size())) return;
        const auto length = get<uint16_t>(head, 20);
        const auto id = get<uint16_t>(head, 18);
        const std::string user(reinterpret_cast<const char*>(head.data()) + 2,
                               strnlen(reinterpret_cast<const char*>(head.data()) + 2, 16));
        offset += 54;
        if (offset + length > end) {
            info.notes.push_back(fmt::format("variable length record {} reaches beyond the point data", i));
            return;
        }
        const bool isWkt = user == "LASF_Projection" && id == 2112;
        const bool isAscii = user == "LASF_Projection" && id == 34737;
        if (isWkt || (isAscii && info.crs.empty())) {
            std::string text(length, '\0');
            if (!file.readAt(offset, text.data(), text.size())) return;
            text.resize(strnlen(text.data(), text.size()));
            info.crs = text;
        }
        offset += length;
    }
}

}  // namespace

Result<PointSource> openLas(const std::string& path) {
    STIPPLE_ASSIGN(InputFile file, InputFile::open(path));
    const uint64_t size = file.sizeBytes();
    const auto bad = [&](const std::string& what, const std::string& hint = "") {
        return fail(ErrorKind::input, what, path, hint);
    };
    if (size < 227)
        return bad(fmt::format("has {} bytes, less than a LAS header (227)", size), "is the download complete?");
    std::vector<uint8_t> header(static_cast<size_t>(std::min<uint64_t>(size, 375)));
    STIPPLE_TRY(file.readAt(0, header.data(), header.size()));
    if (std::memcmp(header.data(), "LASF", 4) != 0) return bad("does not begin with LASF", "is it really a LAS file?");
    const int major = header[24], minor = header[25];
    if (major != 1 || minor > 4) return bad(fmt::format("is LAS {}.{}", major, minor), "LAS 1.0 to 1.4 are read");
    const auto headerBytes = get<uint16_t>(header, 94);
    const uint64_t dataOffset = get<uint32_t>(header, 96);
    const auto vlrs = get<uint32_t>(header, 100);
    const uint8_t formatByte = header[104];
    const auto recordBytes = get<uint16_t>(header, 105);
    uint64_t points = get<uint32_t>(header, 107);
    if (headerBytes < 227)
        return bad(fmt::format("the header says it has {} bytes, at least 227 are needed", headerBytes));
    if (minor >= 4 && headerBytes >= 375 && header.size() >= 375)
        if (const auto wide = get<uint64_t>(header, 247); wide != 0) points = wide;
    if ((formatByte & 0xc0) != 0)
        return bad("is compressed (LAZ)", "this version reads uncompressed LAS; unpack it first");
    const unsigned format = formatByte;
    if (format >= kRecordBytes.size())
        return bad(fmt::format("has point format {}", format), "formats 0 to 10 are read");
    if (recordBytes < kRecordBytes.at(format))
        return bad(fmt::format("has records of {} bytes; point format {} needs {}", recordBytes, format,
                               kRecordBytes.at(format)));
    if (dataOffset < headerBytes || dataOffset > size)
        return bad(fmt::format("the points begin at offset {}, but the file has {} bytes", dataOffset, size),
                   "the file is truncated");
    PointSource source;
    SourceInfo& info = source.info;
    info.path = path;
    info.format = fmt::format("LAS {}.{}, point format {}", major, minor, format);
    const uint64_t fits = (size - dataOffset) / recordBytes;
    if (points > fits)
        return bad(fmt::format("the header declares {} points, but only {} fit into the file", points, fits),
                   "the file is truncated or its header lies");
    info.points = points;
    info.isLattice = true;
    info.up = UpAxis::z;
    for (int a = 0; a < 3; ++a) {
        const auto at = static_cast<size_t>(a) * 8;
        info.scale[a] = get<double>(header, 131 + at);
        info.offset[a] = get<double>(header, 155 + at);
        info.declaredMax[a] = get<double>(header, 179 + at * 2);
        info.declaredMin[a] = get<double>(header, 187 + at * 2);
        if (!(info.scale[a] > 0) || !std::isfinite(info.scale[a]) || !std::isfinite(info.offset[a]))
            return bad(fmt::format("scale {} and offset {} of axis {} are not usable", info.scale[a], info.offset[a],
                                   "xyz"[a]),
                       "the header is damaged");
    }
    info.hasDeclaredBounds = true;
    info.hasColour = kColourOffset.at(format) != 0;
    info.attributes = {"intensity", "return_number", "classification", "scan_angle", "source_id"};
    if (format != 0 && format != 2) info.attributes.emplace_back("gps_time");
    if (info.hasColour) info.attributes.emplace_back("colour");
    readVlrs(file, headerBytes, dataOffset, vlrs, info);
    auto reader = std::make_shared<LasReader>(
        LasReader{std::move(file), 0, points, dataOffset, recordBytes, kColourOffset.at(format), {}});
    source.read = [reader](PointBlock& block, size_t limit) { return reader->read(block, limit); };
    return source;
}

}  // namespace stipple::lod
