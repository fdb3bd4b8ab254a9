#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "apps/grow/grow.h"
#include "engine/base/file.h"

namespace stipple::grow {
namespace {

constexpr double kScale = 0.001;
constexpr size_t kBatch = 65536;

template <typename T>
void put(std::vector<uint8_t>& bytes, size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof(value));
}

/// Records of `record` bytes: `putPoint(bytes, at, point)` writes one at its place.
template <typename PutPoint>
Result<void> writeRecords(OutputFile& file, const std::vector<ScanPoint>& points, size_t record, PutPoint putPoint) {
    std::vector<uint8_t> bytes;
    for (size_t first = 0; first < points.size(); first += kBatch) {
        const size_t count = std::min(kBatch, points.size() - first);
        bytes.assign(count * record, 0);
        for (size_t i = 0; i < count; ++i) putPoint(bytes, i * record, points[first + i]);
        STIPPLE_TRY(file.append(bytes.data(), bytes.size()));
    }
    return {};
}

Result<void> writeLas(OutputFile& file, const std::vector<ScanPoint>& points, const ScanOptions& options) {
    constexpr size_t kRecord = 26, kHeader = 227;
    std::vector<uint8_t> header(kHeader);
    std::memcpy(header.data(), "LASF", 4);
    header[24] = 1;
    header[25] = 2;
    std::memcpy(header.data() + 26, "SIMULATED", 9);
    std::memcpy(header.data() + 58, "stipple grow scan", 17);
    put<uint16_t>(header, 90, 1);  // the first day of 2026, always: the same points are the same bytes
    put<uint16_t>(header, 92, 2026);
    put<uint16_t>(header, 94, kHeader);
    put<uint32_t>(header, 96, kHeader);
    header[104] = 2;
    put<uint16_t>(header, 105, kRecord);
    put<uint32_t>(header, 107, static_cast<uint32_t>(points.size()));
    put<uint32_t>(header, 111, static_cast<uint32_t>(points.size()));
    for (size_t a = 0; a < 3; ++a) {
        double lo = 1e300, hi = -1e300;
        for (const ScanPoint& p : points) {
            lo = std::min(lo, p.position.at(a));
            hi = std::max(hi, p.position.at(a));
        }
        const double origin = options.origin.at(a);
        put(header, 131 + 8 * a, kScale);
        put(header, 155 + 8 * a, origin);
        put(header, 179 + 16 * a, origin + std::round(hi / kScale) * kScale);
        put(header, 187 + 16 * a, origin + std::round(lo / kScale) * kScale);
    }
    STIPPLE_TRY(file.append(header.data(), header.size()));
    return writeRecords(file, points, kRecord, [](std::vector<uint8_t>& bytes, size_t at, const ScanPoint& p) {
        for (size_t a = 0; a < 3; ++a) {
            put(bytes, at + 4 * a, static_cast<int32_t>(std::lround(p.position.at(a) / kScale)));
            put(bytes, at + 20 + 2 * a, static_cast<uint16_t>(p.colour.at(a) * 257));
        }
        put<uint8_t>(bytes, at + 14, 0x09);  // return 1 of 1
    });
}

Result<void> writePly(OutputFile& file, const std::vector<ScanPoint>& points, const ScanOptions& options) {
    const std::string header = fmt::format(
        "ply\nformat binary_little_endian 1.0\ncomment stipple grow scan --seed {}\nelement vertex {}\n"
        "property double x\nproperty double y\nproperty double z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        options.seed, points.size());
    STIPPLE_TRY(file.append(header.data(), header.size()));
    return writeRecords(file, points, 27, [&](std::vector<uint8_t>& bytes, size_t at, const ScanPoint& p) {
        for (size_t a = 0; a < 3; ++a) {
            put(bytes, at + 8 * a, p.position.at(a) + options.origin.at(a));
            bytes[at + 24 + a] = p.colour.at(a);
        }
    });
}

}  // namespace

Result<void> checkScanPath(const std::string& path) {
    const std::string extension = std::filesystem::path(path).extension().string();
    if (extension == ".las" || extension == ".ply") return {};
    return fail(ErrorKind::usage, "scans are written as .las or .ply", path, "change the extension");
}

Result<void> writeScan(const std::string& path, const std::vector<ScanPoint>& points, const ScanOptions& options) {
    STIPPLE_TRY(checkScanPath(path));
    STIPPLE_ASSIGN(OutputFile file, OutputFile::create(path));
    STIPPLE_TRY(std::filesystem::path(path).extension() == ".las" ? writeLas(file, points, options)
                                                                  : writePly(file, points, options));
    return file.commit();
}

}  // namespace stipple::grow
