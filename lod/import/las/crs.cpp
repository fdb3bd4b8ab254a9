// Coordinate systems: enough of WKT (OGC 01-009 and 12-063) and of the GeoTIFF keys (OGC 19-008) to name one, to tell
// two apart and to know how long a unit is.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "engine/base/text.h"
#include "lod/import/las/header.h"

namespace stipple::lod {

std::string Crs::label() const {
    if (epsg != 0) return name.empty() ? fmt::format("EPSG:{}", epsg) : fmt::format("EPSG:{} ({})", epsg, name);
    return name;
}

bool Crs::agreesWith(const Crs& other) const {
    if (epsg != 0 && other.epsg != 0) return epsg == other.epsg;
    if (name.empty() || other.name.empty()) return true;
    return name == other.name;
}

}  // namespace stipple::lod

namespace stipple::las {
namespace {

constexpr double kFoot = 0.3048, kSurveyFoot = 1200.0 / 3937.0;

/// The text between the first pair of quotes at or after `from`.
std::string quoted(const std::string& s, size_t from) {
    const size_t open = s.find('"', from);
    if (open == std::string::npos) return "";
    const size_t close = s.find('"', open + 1);
    return close == std::string::npos ? "" : s.substr(open + 1, close - open - 1);
}

/// The bracketed node that begins with `keyword` at depth 1 of the node at `at`; npos: none. The last one wins: WKT
/// puts the unit and the authority of a node after those of its parts.
size_t childOf(const std::string& s, size_t at, const std::string& keyword) {
    size_t found = std::string::npos;
    int depth = 0;
    bool inText = false;
    for (size_t i = s.find('[', at); i < s.size(); ++i) {
        if (s[i] == '"') inText = !inText;
        if (inText) continue;
        if (s[i] == '[') ++depth;
        if (s[i] == ']' && --depth == 0) break;
        if (depth == 1 && (s[i] == ',' || s[i] == '[')) {
            size_t k = i + 1;
            while (k < s.size() && std::isspace(static_cast<unsigned char>(s[k]))) ++k;
            if (s.compare(k, keyword.size() + 1, keyword + "[") == 0) found = k;
        }
    }
    return found;
}

double numberAfterName(const std::string& s, size_t node) {
    const size_t open = s.find('"', node);
    const size_t close = open == std::string::npos ? open : s.find('"', open + 1);
    const size_t comma = close == std::string::npos ? close : s.find(',', close);
    return comma == std::string::npos ? 0 : std::strtod(s.c_str() + comma + 1, nullptr);
}

/// A compound system stands for its horizontal part.
size_t horizontalNode(const std::string& s) {
    for (const char* keyword : {"PROJCS[", "PROJCRS[", "PROJECTEDCRS[", "GEOCCS[", "GEODCRS[", "GEODETICCRS[",
                                "GEOGCRS[", "GEOGRAPHICCRS[", "GEOGCS[", "LOCAL_CS[", "ENGCRS["})
        if (const size_t at = s.find(keyword); at != std::string::npos) return at;
    return std::string::npos;
}

lod::Crs fromWkt(const std::string& wkt) {
    lod::Crs crs;
    crs.text = wkt;
    const size_t node = horizontalNode(wkt);
    if (node == std::string::npos) {
        crs.name = quoted(wkt, 0);
        return crs;
    }
    crs.name = quoted(wkt, node);
    for (const char* keyword : {"AUTHORITY", "ID"})
        if (const size_t id = childOf(wkt, node, keyword); id != std::string::npos && quoted(wkt, id) == "EPSG") {
            const size_t comma = wkt.find(',', id);
            size_t digits = comma == std::string::npos ? comma : wkt.find_first_of("0123456789", comma);
            if (digits != std::string::npos) crs.epsg = std::atoi(wkt.c_str() + digits);
        }
    const bool isProjected = wkt.compare(node, 4, "PROJ") == 0;
    const bool isCartesian = isProjected || wkt.compare(node, 6, "GEOCCS") == 0 || wkt.compare(node, 5, "LOCAL") == 0 ||
                             wkt.compare(node, 3, "ENG") == 0 || wkt.find("CS[Cartesian", node) != std::string::npos;
    for (const char* keyword : {"UNIT", "LENGTHUNIT"})
        if (const size_t unit = childOf(wkt, node, keyword); unit != std::string::npos && isCartesian)
            if (const double metres = numberAfterName(wkt, unit); metres > 0 && std::isfinite(metres))
                crs.metresPerUnit = metres;
    if (isCartesian && wkt.find("LENGTHUNIT[", node) != std::string::npos &&
        childOf(wkt, node, "LENGTHUNIT") == std::string::npos) {  // WKT 2 gives the unit with each axis
        const double metres = numberAfterName(wkt, wkt.rfind("LENGTHUNIT["));
        if (metres > 0 && std::isfinite(metres)) crs.metresPerUnit = metres;
    }
    crs.isDegrees = !isCartesian;
    crs.isGeocentric = isCartesian && wkt.compare(node, 3, "GEO") == 0;
    return crs;
}

lod::Crs fromGeoKeys(const std::vector<uint8_t>& keys, const std::string& ascii) {
    lod::Crs crs;
    const auto word = [&](size_t i) {
        uint16_t v = 0;
        if (2 * i + 2 <= keys.size()) std::memcpy(&v, keys.data() + 2 * i, 2);
        return v;
    };
    const size_t count = std::min<size_t>(word(3), keys.size() / 8);
    int model = 0, projected = 0, geographic = 0, unit = 0;
    std::string citation, geographicCitation;
    const auto textOf = [&](size_t entry) {
        const size_t length = word(entry + 2), offset = word(entry + 3);
        if (word(entry + 1) != 34737 || offset >= ascii.size()) return std::string();
        std::string s = ascii.substr(offset, length);
        s.resize(strnlen(s.data(), s.size()));
        while (!s.empty() && (s.back() == '|' || s.back() == ' ')) s.pop_back();
        return s;
    };
    for (size_t i = 1; i <= count; ++i) {
        const size_t entry = 4 * i;
        const bool isShort = word(entry + 1) == 0;
        switch (word(entry)) {
            case 1024:
                model = isShort ? word(entry + 3) : 0;
                break;
            case 1026:
                citation = textOf(entry);
                break;
            case 2048:
                geographic = isShort ? word(entry + 3) : 0;
                break;
            case 2049:
                geographicCitation = textOf(entry);
                break;
            case 3072:
                projected = isShort ? word(entry + 3) : 0;
                break;
            case 3073:
                citation = textOf(entry).empty() ? citation : textOf(entry);
                break;
            case 3076:
                unit = isShort ? word(entry + 3) : 0;
                break;
            default:
                break;
        }
    }
    constexpr int kUserDefined = 32767;
    crs.isDegrees = model == 2;
    crs.isGeocentric = model == 3;
    crs.epsg = model == 1 || projected != 0 ? projected : geographic;
    if (crs.epsg == kUserDefined) crs.epsg = 0;
    crs.name = !citation.empty() && model != 2 ? citation : !geographicCitation.empty() ? geographicCitation : citation;
    crs.text = crs.name;
    if (unit == 9002) crs.metresPerUnit = kFoot;
    if (unit == 9003) crs.metresPerUnit = kSurveyFoot;
    return crs;
}

}  // namespace

lod::Crs crsOf(const std::string& wkt, const std::vector<uint8_t>& geoKeys, const std::string& geoAscii) {
    lod::Crs crs;
    if (!wkt.empty())
        crs = fromWkt(wkt);
    else if (geoKeys.size() >= 8)
        crs = fromGeoKeys(geoKeys, geoAscii);
    crs.name = printable(crs.name);
    crs.text = toUtf8(crs.text);
    return crs;
}

}  // namespace stipple::las
