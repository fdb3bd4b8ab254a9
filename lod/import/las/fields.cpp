// The attributes of each point format, and those that the extra bytes record describes (LAS 1.4, table 24).
#include <fmt/format.h>

#include <cmath>

#include "lod/import/las/header.h"

namespace stipple::las {
namespace {

using lod::Aggregate;
using lod::ScalarType;

Field whole(uint32_t offset, uint32_t part, const char* name, ScalarType type, Aggregate aggregate,
            const char* description = "") {
    Field f;
    f.offset = offset;
    f.lazPart = part;
    f.info.name = name;
    f.info.type = type;
    f.info.aggregate = aggregate;
    f.info.description = description;
    return f;
}

Field bits(uint32_t offset, uint32_t part, uint8_t mask, const char* name, const char* description = "") {
    Field f = whole(offset, part, name, ScalarType::u8, Aggregate::mode, description);
    f.mask = mask;
    while ((mask >> f.shift & 1u) == 0) ++f.shift;
    return f;
}

void addWave(std::vector<Field>& fields, uint32_t at) {
    fields.push_back(whole(at, kLazWave, "wave_descriptor", ScalarType::u8, Aggregate::none));
    fields.push_back(whole(at + 1, kLazWave, "wave_offset", ScalarType::u64, Aggregate::none, "bytes"));
    fields.push_back(whole(at + 9, kLazWave, "wave_size", ScalarType::u32, Aggregate::none, "bytes"));
    fields.push_back(whole(at + 13, kLazWave, "wave_return_point", ScalarType::f32, Aggregate::none, "picoseconds"));
    fields.push_back(whole(at + 17, kLazWave, "wave_x", ScalarType::f32, Aggregate::none));
    fields.push_back(whole(at + 21, kLazWave, "wave_y", ScalarType::f32, Aggregate::none));
    fields.push_back(whole(at + 25, kLazWave, "wave_z", ScalarType::f32, Aggregate::none));
}

std::vector<Field> oldFields(unsigned format) {
    std::vector<Field> f{
        whole(12, kLazIntensity, "intensity", ScalarType::u16, Aggregate::mean),
        bits(14, kLazPosition, 0x07, "return_number"),
        bits(14, kLazPosition, 0x38, "number_of_returns"),
        bits(14, kLazFlags, 0x40, "scan_direction"),
        bits(14, kLazFlags, 0x80, "edge_of_flight_line"),
        bits(15, kLazClassification, 0x1f, "classification"),
        bits(15, kLazClassification, 0xe0, "classification_flags", "1 synthetic, 2 key point, 4 withheld"),
        whole(16, kLazScanAngle, "scan_angle", ScalarType::i8, Aggregate::mean, "degrees"),
        whole(17, kLazUserData, "user_data", ScalarType::u8, Aggregate::mode),
        whole(18, kLazSource, "source_id", ScalarType::u16, Aggregate::mode)};
    if (format == 1 || format >= 3)
        f.push_back(whole(20, kLazTime, "gps_time", ScalarType::f64, Aggregate::none, "seconds"));
    if (format == 4) addWave(f, 28);
    if (format == 5) addWave(f, 34);
    return f;
}

std::vector<Field> newFields(unsigned format) {
    std::vector<Field> f{
        whole(12, kLazIntensity, "intensity", ScalarType::u16, Aggregate::mean),
        bits(14, kLazPosition, 0x0f, "return_number"),
        bits(14, kLazPosition, 0xf0, "number_of_returns"),
        bits(15, kLazFlags, 0x0f, "classification_flags", "1 synthetic, 2 key point, 4 withheld, 8 overlap"),
        bits(15, kLazPosition, 0x30, "scanner_channel"),
        bits(15, kLazFlags, 0x40, "scan_direction"),
        bits(15, kLazFlags, 0x80, "edge_of_flight_line"),
        whole(16, kLazClassification, "classification", ScalarType::u8, Aggregate::mode),
        whole(17, kLazUserData, "user_data", ScalarType::u8, Aggregate::mode),
        whole(18, kLazScanAngle, "scan_angle", ScalarType::i16, Aggregate::mean, "degrees"),
        whole(20, kLazSource, "source_id", ScalarType::u16, Aggregate::mode),
        whole(22, kLazTime, "gps_time", ScalarType::f64, Aggregate::none, "seconds")};
    f[9].info.scale = 0.006;
    if (format == 8 || format == 10)
        f.push_back(whole(36, kLazInfrared, "near_infrared", ScalarType::u16, Aggregate::mean));
    if (format == 9) addWave(f, 30);
    if (format == 10) addWave(f, 38);
    return f;
}

constexpr size_t kDescriptorBytes = 192;

std::string text(const uint8_t* from, size_t count) {
    const auto* chars = reinterpret_cast<const char*>(from);
    std::string s(chars, strnlen(chars, count));
    for (char& c : s)
        if (static_cast<unsigned char>(c) < 32 || static_cast<unsigned char>(c) > 126) c = '?';
    return s;
}

double doubleAt(const uint8_t* from) {
    double v = 0;
    std::memcpy(&v, from, 8);
    return v;
}

/// Integers stand there in 64 bits, fp32 as fp64. Nothing for what is no number: that has no data anyway.
std::optional<double> noDataAt(const uint8_t* from, ScalarType type) {
    if (type == ScalarType::f32 || type == ScalarType::f64) {
        const double v = doubleAt(from);
        return std::isfinite(v) ? std::optional(v) : std::nullopt;
    }
    int64_t v = 0;
    std::memcpy(&v, from, 8);
    const bool isSigned =
        type == ScalarType::i8 || type == ScalarType::i16 || type == ScalarType::i32 || type == ScalarType::i64;
    return isSigned ? static_cast<double>(v) : static_cast<double>(static_cast<uint64_t>(v));
}

/// The fields of one descriptor; its bytes in the record. Types 11 to 30 are the deprecated pairs and triples.
uint32_t addDescribed(const uint8_t* d, uint32_t at, std::vector<Field>& fields) {
    const unsigned type = d[2], options = d[3];
    if (type == 0 || type > 30) return type == 0 ? options : 0;
    const unsigned count = (type - 1) / 10 + 1;
    const auto scalar = static_cast<ScalarType>((type - 1) % 10);
    std::string name = text(d + 4, 32);
    if (name.empty()) name = fmt::format("extra_{}", at);
    for (unsigned i = 0; i < count; ++i) {
        Field f = whole(at + i * static_cast<uint32_t>(lod::bytesOf(scalar)), kLazExtra, "", scalar, Aggregate::mean);
        f.info.name = count == 1 ? name : fmt::format("{}_{}", name, i);
        f.info.description = text(d + 160, 32);
        if ((options & 8u) != 0) f.info.scale = doubleAt(d + 112 + 8 * i);
        if ((options & 16u) != 0) f.info.offset = doubleAt(d + 136 + 8 * i);
        if ((options & 1u) != 0) f.info.noData = noDataAt(d + 40 + 8 * i, scalar);
        if (!std::isfinite(f.info.scale) || f.info.scale == 0 || !std::isfinite(f.info.offset)) {
            f.info.scale = 1;
            f.info.offset = 0;
        }
        fields.push_back(f);
    }
    return count * static_cast<uint32_t>(lod::bytesOf(scalar));
}

}  // namespace

std::vector<Field> fieldsOf(unsigned format, uint32_t recordBytes, const std::vector<uint8_t>& extraBytes,
                            std::vector<std::string>& notes) {
    std::vector<Field> fields = format <= 5 ? oldFields(format) : newFields(format);
    uint32_t at = kRecordBytes.at(format);
    for (size_t i = 0; i + kDescriptorBytes <= extraBytes.size() && at < recordBytes; i += kDescriptorBytes) {
        std::vector<Field> described;
        const uint32_t bytes = addDescribed(extraBytes.data() + i, at, described);
        if (bytes == 0 || bytes > recordBytes - at) {
            notes.push_back(fmt::format("extra bytes descriptor {} does not fit the {} bytes that are left of a record",
                                        i / kDescriptorBytes, recordBytes - at));
            break;
        }
        for (Field& f : described) {
            const auto taken = [&](const std::string& name) {
                return std::any_of(fields.begin(), fields.end(), [&](const Field& g) { return g.info.name == name; });
            };
            for (int k = 2; taken(f.info.name); ++k) f.info.name = fmt::format("{}_{}", described[0].info.name, k);
            fields.push_back(f);
        }
        at += bytes;
    }
    if (at < recordBytes)
        notes.push_back(fmt::format("{} bytes at the end of each record are not described", recordBytes - at));
    return fields;
}

}  // namespace stipple::las
