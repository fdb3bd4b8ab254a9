// The LAS header, its variable length records and what follows from them (ASPRS LAS 1.0 to 1.4; 1.5 headers are read as
// far as they agree with 1.4). Nothing is believed that the size of the file does not bear out.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lod/import/las/laz.h"
#include "lod/primitives/primitives.h"

namespace stipple::las {

/// Bytes of a record of each point format without extra bytes.
inline constexpr std::array<uint16_t, 11> kRecordBytes{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

struct Vlr {
    std::string user, description;
    uint16_t id = 0;
    uint64_t offset = 0, bytes = 0;  ///< of the payload
    bool isExtended = false;
};

/// Where a field lies in a record. `mask` 0: the whole value; otherwise the masked bits of one byte, shifted down.
struct Field {
    uint32_t offset = 0;
    uint8_t mask = 0, shift = 0;
    uint32_t lazPart = 0;  ///< LazParts that it comes from
    lod::AttributeInfo info;
};

struct LasHeader {
    std::string path;
    int minor = 0;
    unsigned format = 0;
    uint32_t recordBytes = 0, headerBytes = 0;
    uint64_t fileBytes = 0, dataOffset = 0, points = 0;
    std::array<uint64_t, 15> pointsByReturn{};
    glm::dvec3 scale{1}, offset{0}, least{0}, greatest{0};
    uint16_t globalEncoding = 0, day = 0, year = 0;
    std::string system, software;
    std::vector<Vlr> vlrs;
    std::optional<LazPlan> laz;
    uint32_t colourOffset = 0;  ///< byte of red in a record; 0: the format has no colours
    std::vector<Field> fields;  ///< everything but position and colour
    lod::Crs crs;
    std::vector<std::string> notes;
    bool isCopc = false;
    /// "LAZ 1.4, point format 7, chunks of 50000 points".
    std::string describe() const;
};

/// `path` is for messages. `tolerant`: a header that promises more than the file holds is cut down to what is there
/// (and noted) instead of refused.
Result<LasHeader> readLasHeader(const Bytes& in, const std::string& path, bool tolerant);

/// Fields of a point format, and of the extra bytes that `extraBytes` (payload of record 4, may be empty) describes.
std::vector<Field> fieldsOf(unsigned format, uint32_t recordBytes, const std::vector<uint8_t>& extraBytes,
                            std::vector<std::string>& notes);

/// The coordinate system from WKT (`wkt`, may be empty) or from GeoTIFF keys (payloads of 34735 and 34737).
lod::Crs crsOf(const std::string& wkt, const std::vector<uint8_t>& geoKeys, const std::string& geoAscii);

}  // namespace stipple::las
