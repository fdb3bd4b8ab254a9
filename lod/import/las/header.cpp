#include "lod/import/las/header.h"

#include <fmt/format.h>

#include <cmath>

namespace stipple::las {
namespace {

/// Byte of red in each point format; 0: no colour.
constexpr std::array<uint16_t, 11> kColourOffset{0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
constexpr size_t kMostVlrBytes = 1 << 20;  ///< of a payload that is looked into

template <typename T>
T get(const std::vector<uint8_t>& bytes, size_t offset) {
    T value{};
    if (offset + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + offset, sizeof(T));
    return value;
}

std::string text(const std::vector<uint8_t>& bytes, size_t offset, size_t count) {
    const auto* from = reinterpret_cast<const char*>(bytes.data()) + offset;
    std::string s(from, strnlen(from, std::min(count, bytes.size() - offset)));
    for (char& c : s)
        if (static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126) c = '?';
    while (!s.empty() && s.back() == ' ') s.pop_back();
    return s;
}

Result<std::vector<uint8_t>> payload(const Bytes& in, const Vlr& v) {
    std::vector<uint8_t> bytes(static_cast<size_t>(std::min<uint64_t>(v.bytes, kMostVlrBytes)));
    STIPPLE_TRY(in.readAt(v.offset, bytes.data(), bytes.size()));
    return bytes;
}

/// Lists the records; one that does not fit ends the list and is noted.
Result<void> listVlrs(const Bytes& in, uint64_t offset, uint64_t end, uint64_t declared, bool extended, LasHeader& h) {
    const size_t headBytes = extended ? 60 : 54;
    const char* const kind = extended ? "extended variable length record" : "variable length record";
    std::vector<uint8_t> head(headBytes);
    for (uint64_t i = 0; i < declared; ++i) {
        if (offset > end || end - offset < headBytes) {
            h.notes.push_back(fmt::format("the header declares {} {}s, but only {} fit", declared, kind, i));
            return {};
        }
        STIPPLE_TRY(in.readAt(offset, head.data(), headBytes));
        Vlr v;
        v.user = text(head, 2, 16);
        v.id = get<uint16_t>(head, 18);
        v.bytes = extended ? get<uint64_t>(head, 20) : get<uint16_t>(head, 20);
        v.description = text(head, extended ? 28 : 22, 32);
        v.offset = offset + headBytes;
        v.isExtended = extended;
        if (v.bytes > end - v.offset) {
            h.notes.push_back(fmt::format("{} {} ({} {}) at offset {} has {} bytes, {} are left", kind, i, v.user, v.id,
                                          offset, v.bytes, end - v.offset));
            return {};
        }
        offset = v.offset + v.bytes;
        h.vlrs.push_back(std::move(v));
    }
    return {};
}

/// What the payloads say: compression, coordinate system, extra bytes.
Result<void> useVlrs(const Bytes& in, LasHeader& h, bool compressed) {
    std::string wkt, geoAscii;
    std::vector<uint8_t> geoKeys, extraBytes;
    for (const Vlr& v : h.vlrs) {
        const bool isProjection = v.user == "LASF_Projection";
        if (isProjection && v.id == 2112) {
            STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, payload(in, v));
            wkt.assign(bytes.begin(), bytes.end());
            wkt.resize(strnlen(wkt.data(), wkt.size()));
        } else if (isProjection && v.id == 34735) {
            STIPPLE_ASSIGN(geoKeys, payload(in, v));
        } else if (isProjection && v.id == 34737) {
            STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, payload(in, v));
            geoAscii.assign(bytes.begin(), bytes.end());
        } else if (v.user == "LASF_Spec" && v.id == 4) {
            STIPPLE_ASSIGN(extraBytes, payload(in, v));
        } else if (v.user == "copc" && v.id == 1) {
            h.isCopc = true;
        } else if (v.user == "laszip encoded" && v.id == 22204 && compressed && !h.laz) {
            STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, payload(in, v));
            auto plan = parseLazPlan(bytes.data(), bytes.size(), h.format, h.recordBytes);
            if (!plan) {
                plan.error().where = fmt::format("{}: record at offset {}", h.path, v.offset);
                return tl::unexpected(plan.error());
            }
            h.laz = *plan;
        }
    }
    h.crs = crsOf(wkt, geoKeys, geoAscii);
    h.fields = fieldsOf(h.format, h.recordBytes, extraBytes, h.notes);
    return {};
}

Result<void> readScales(const std::vector<uint8_t>& b, LasHeader& h) {
    const auto bad = [&](const std::string& what) {
        return fail(ErrorKind::input, what, h.path, "the header is damaged");
    };
    for (int a = 0; a < 3; ++a) {
        const auto at = static_cast<size_t>(a) * 8;
        h.scale[a] = get<double>(b, 131 + at);
        h.offset[a] = get<double>(b, 155 + at);
        h.greatest[a] = get<double>(b, 179 + at * 2);
        h.least[a] = get<double>(b, 187 + at * 2);
        if (!(h.scale[a] > 0) || !std::isfinite(h.scale[a]) || !std::isfinite(h.offset[a]))
            return bad(fmt::format("scale {} and offset {} of axis {} (offsets {} and {}) are not usable", h.scale[a],
                                   h.offset[a], "xyz"[a], 131 + at, 155 + at));
        // What follows takes squares and volumes of them.
        constexpr double kFarthest = 1e100, kSteps = 2147483648.0;
        if (!(h.scale[a] * kSteps + std::abs(h.offset[a]) <= kFarthest))
            return bad(fmt::format("scale {} and offset {} of axis {} (offsets {} and {}) reach farther than {}",
                                   h.scale[a], h.offset[a], "xyz"[a], 131 + at, 155 + at, kFarthest));
    }
    return {};
}

/// What a file of its size can hold.
Result<void> checkPoints(bool compressed, bool tolerant, LasHeader& h) {
    const auto bad = [&](const std::string& what, const std::string& hint) {
        return fail(ErrorKind::input, what, h.path, hint);
    };
    if (compressed) {
        if (!h.laz) return bad("is compressed (offset 104) but has no `laszip encoded` record", "the file is damaged");
        // A compressed point takes at least some bits; a chunk its first point in full.
        const uint64_t most = (h.fileBytes - h.dataOffset) * kMostPointsPerByte;
        if (h.points > most)
            return bad(fmt::format("the header declares {} points, {} bytes cannot hold more than {}", h.points,
                                   h.fileBytes - h.dataOffset, most),
                       "the file is truncated or its header lies");
    } else {
        const uint64_t fits = (h.fileBytes - h.dataOffset) / h.recordBytes;
        if (h.points > fits && !tolerant)
            return bad(fmt::format("the header declares {} points, but only {} fit into the file", h.points, fits),
                       "the file is truncated or its header lies; --skip-bad reads what is there");
        if (h.points > fits)
            h.notes.push_back(
                fmt::format("the header declares {} points, but only {} fit into the file", h.points, fits));
    }
    return {};
}

}  // namespace

std::string LasHeader::describe() const {
    std::string s = fmt::format("{} 1.{}, point format {}",
                                !laz     ? "LAS"
                                : isCopc ? "COPC (LAZ)"
                                         : "LAZ",
                                minor, format);
    if (!laz) return s;
    if (laz->form == LazForm::pointwise) return s + ", one chunk";
    if (laz->chunkPoints == LazPlan::kVariableChunks) return s + ", chunks of different sizes";
    return s + fmt::format(", chunks of {} points", laz->chunkPoints);
}

Result<LasHeader> readLasHeader(const Bytes& in, const std::string& path, bool tolerant) {
    const auto bad = [&](const std::string& what, const std::string& hint = "") {
        return fail(ErrorKind::input, what, path, hint);
    };
    LasHeader h;
    h.path = path;
    h.fileBytes = in.size;
    if (in.size < 227)
        return bad(fmt::format("has {} bytes, less than a LAS header (227)", in.size), "is the download complete?");
    std::vector<uint8_t> b(static_cast<size_t>(std::min<uint64_t>(in.size, 375)));
    STIPPLE_TRY(in.readAt(0, b.data(), b.size()));
    if (std::memcmp(b.data(), "LASF", 4) != 0) return bad("does not begin with LASF", "is it really a LAS file?");
    const int major = b[24];
    h.minor = b[25];
    if (major != 1 || h.minor > 5)
        return bad(fmt::format("is LAS {}.{} (bytes 24 and 25)", major, h.minor), "LAS 1.0 to 1.5 are read");
    if (h.minor == 5) h.notes.emplace_back("LAS 1.5: read as 1.4, which its header contains");
    h.globalEncoding = get<uint16_t>(b, 6);
    h.system = text(b, 26, 32);
    h.software = text(b, 58, 32);
    h.day = get<uint16_t>(b, 90);
    h.year = get<uint16_t>(b, 92);
    h.headerBytes = get<uint16_t>(b, 94);
    h.dataOffset = get<uint32_t>(b, 96);
    const auto vlrs = get<uint32_t>(b, 100);
    const bool compressed = (b[104] & 0xc0) != 0;
    h.format = b[104] & 0x3fu;
    h.recordBytes = get<uint16_t>(b, 105);
    h.points = get<uint32_t>(b, 107);
    for (size_t i = 0; i < 5; ++i) h.pointsByReturn.at(i) = get<uint32_t>(b, 111 + 4 * i);
    if (h.headerBytes < 227)
        return bad(fmt::format("the header says it has {} bytes (offset 94), at least 227 are needed", h.headerBytes));
    const bool isWide = h.minor >= 4 && h.headerBytes >= 375 && b.size() >= 375;
    if (isWide) {
        if (const auto wide = get<uint64_t>(b, 247); wide != 0) {
            if (h.points != 0 && h.points != wide)
                h.notes.push_back(fmt::format(
                    "the header counts {} points at offset 107 and {} at 247; the latter is used", h.points, wide));
            h.points = wide;
            for (size_t i = 0; i < 15; ++i) h.pointsByReturn.at(i) = get<uint64_t>(b, 255 + 8 * i);
        }
    }
    if (h.format >= kRecordBytes.size())
        return bad(fmt::format("has point format {} (offset 104)", h.format), "formats 0 to 10 are read");
    if (h.recordBytes < kRecordBytes.at(h.format))
        return bad(fmt::format("has records of {} bytes (offset 105); point format {} needs {}", h.recordBytes,
                               h.format, kRecordBytes.at(h.format)));
    if (h.dataOffset < h.headerBytes || h.dataOffset > in.size)
        return bad(fmt::format("the points begin at offset {}, but the file has {} bytes", h.dataOffset, in.size),
                   "the file is truncated");
    STIPPLE_TRY(readScales(b, h));
    h.colourOffset = kColourOffset.at(h.format);
    STIPPLE_TRY(listVlrs(in, h.headerBytes, h.dataOffset, vlrs, false, h));
    if (isWide && get<uint32_t>(b, 243) != 0)
        STIPPLE_TRY(listVlrs(in, get<uint64_t>(b, 235), in.size, get<uint32_t>(b, 243), true, h));
    STIPPLE_TRY(useVlrs(in, h, compressed));
    STIPPLE_TRY(checkPoints(compressed, tolerant, h));
    return h;
}

}  // namespace stipple::las
