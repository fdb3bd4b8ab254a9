// Primitives as plain arrays: what readers give and the build takes.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "lod/primitives/point_material.h"

namespace stipple::lod {

enum class UpAxis : uint8_t { x = 0, y = 1, z = 2 };
inline glm::dvec3 axisVector(UpAxis up) { return {up == UpAxis::x, up == UpAxis::y, up == UpAxis::z}; }

/// How the values of one attribute are stored.
enum class ScalarType : uint8_t { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };
/// sRGB colour of points and PLY meshes that have none: light enough to show shading, the same for both.
inline constexpr uint32_t kPlainColour = 0xc8c8c8u;

inline constexpr std::array<uint8_t, 10> kScalarBytes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
inline constexpr std::array<const char*, 10> kScalarNames{"u8",  "i8",  "u16", "i16", "u32",
                                                          "i32", "u64", "i64", "f32", "f64"};
inline size_t bytesOf(ScalarType type) { return kScalarBytes.at(static_cast<size_t>(type)); }

/// What a coarse record says of the points below it: their mean, their most frequent value (the smallest of equals), or
/// the value of one of them (where neither means anything, e.g. identifiers).
enum class Aggregate : uint8_t { mean, mode, none };
inline constexpr std::array<const char*, 3> kAggregateNames{"mean", "mode", "none"};

/// One attribute beside position, colour and normal: value = stored * scale + offset.
struct AttributeInfo {
    std::string name;
    ScalarType type = ScalarType::u8;
    Aggregate aggregate = Aggregate::mean;
    double scale = 1, offset = 0;
    std::string description;
    std::optional<double> noData;  ///< the stored value that says "not measured", where the file declares one
    // Only in a store, over all its points that have data: range, and 2nd and 98th percentile.
    double least = 0, greatest = 0, low = 0, high = 0;
    uint64_t withoutData = 0;                         ///< points that have no data
    std::vector<std::pair<double, uint64_t>> counts;  ///< value and number of points, of 8-bit categories
};

/// A run of points from a reader. Arrays are either empty (attribute absent) or as long as `position` or `lattice`.
struct PointBlock {
    std::vector<glm::dvec3> position;  ///< file units
    std::vector<glm::ivec3> lattice;   ///< whole steps, instead of `position`, where SourceInfo::isLattice
    std::vector<uint32_t> colour;      ///< r | g << 8 | b << 16, each 8 bit as stored in the file (see colourMax)
    std::vector<glm::vec3> normal;     ///< any length; zero where the file has none
    std::vector<float> radius;         ///< file units
    std::vector<uint8_t> material;     ///< into SourceInfo::materials; empty: all have the first
    uint32_t colourMax = 0;            ///< largest channel value before the 16 to 8 bit reduction (16-bit files)
    std::vector<uint64_t> colour16;    ///< r | g << 16 | b << 32, instead of `colour`, where the file has 16 bits
    /// Stored values of the attributes that were asked for, in the order of ReadOptions::attributes; an attribute that
    /// the file does not have is empty.
    std::vector<std::vector<uint8_t>> attributes;
    /// Keeps the memory.
    void clear() {
        position.clear();
        lattice.clear();
        colour.clear();
        normal.clear();
        radius.clear();
        colour16.clear();
        material.clear();
        for (auto& values : attributes) values.clear();
        colourMax = 0;
    }
};

/// A coordinate reference system, as far as a file names it.
struct Crs {
    std::string name;  ///< e.g. "NAD83 / UTM zone 10N"; empty: the file names none
    int epsg = 0;      ///< 0: not given
    std::string text;  ///< WKT, or the GeoTIFF citation
    double metresPerUnit = 1;
    bool isDegrees = false, isGeocentric = false;
    /// "EPSG:26910 (NAD83 / UTM zone 10N)".
    std::string label() const;
    /// False only if both are named and differ.
    bool agreesWith(const Crs& other) const;
};

/// What a file says of itself, checked as far as its size allows.
struct SourceInfo {
    std::string path, format;
    uint64_t points = 0;  ///< declared, and possible by the size of the file
    bool hasColour = false, hasNormal = false, hasRadius = false;
    bool isLattice = false;          ///< positions are whole steps: world = position * scale + offset
    bool isCompressed = false;       ///< who reads points again decompresses them again
    glm::dvec3 scale{1}, offset{0};  ///< only where isLattice
    glm::dvec3 declaredMin{0}, declaredMax{0};
    bool hasDeclaredBounds = false;
    bool isReflectance = false;  ///< colours are of the material, to be lit; otherwise as a scanner's camera saw them
    bool isTwoSided = false;     ///< surfaces are seen from both sides
    UpAxis up = UpAxis::y;
    Crs crs;
    std::vector<AttributeInfo> attributes;  ///< that can be asked for
    std::vector<std::string> notes;         ///< what is odd about the file, for a person
    std::vector<PointMaterial> materials;   ///< of its points: PointBlock::material counts them
};

struct ReadOptions {
    std::vector<std::string> attributes;  ///< names of what is wanted beside position, colour and normal
    bool skipBad = false;                 ///< go on past what is corrupt; the caller counts what is lost
};

/// Appends up to `limit` points to a cleared block and returns how many; 0 is the end.
using PointReader = std::function<Result<size_t>(PointBlock& block, size_t limit)>;

/// A file whose header was read. Its points come in parts that can be read independently and at once.
struct PointSource {
    SourceInfo info;
    std::vector<uint64_t> parts;  ///< points in each part, as declared
    std::function<Result<PointReader>(size_t part)> openPart;
};

}  // namespace stipple::lod
