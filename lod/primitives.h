// Primitives as plain arrays: what readers give and the build takes.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::lod {

enum class UpAxis : uint8_t { x = 0, y = 1, z = 2 };

/// A run of points from a reader. Arrays are either empty (attribute absent) or as long as `position`.
struct PointBlock {
    std::vector<glm::dvec3> position;  ///< file units, or whole lattice steps where SourceInfo::isLattice
    std::vector<uint32_t> colour;      ///< r | g << 8 | b << 16, each 8 bit as stored in the file (see colourMax)
    std::vector<glm::vec3> normal;     ///< any length; zero where the file has none
    std::vector<float> radius;         ///< file units
    uint32_t colourMax = 0;            ///< largest channel value before the 16 to 8 bit reduction (16-bit files)
    std::vector<uint64_t> colour16;    ///< r | g << 16 | b << 32, instead of `colour`, where the file has 16 bits
    void clear() { *this = PointBlock(); }
};

/// What a file says of itself, checked as far as its size allows.
struct SourceInfo {
    std::string path, format;
    uint64_t points = 0;  ///< declared, and possible by the size of the file
    bool hasColour = false, hasNormal = false, hasRadius = false;
    bool isLattice = false;          ///< positions are whole steps: world = position * scale + offset
    glm::dvec3 scale{1}, offset{0};  ///< only where isLattice
    glm::dvec3 declaredMin{0}, declaredMax{0};
    bool hasDeclaredBounds = false;
    UpAxis up = UpAxis::y;
    std::string crs;
    std::vector<std::string> attributes;  ///< names, as in the file
    std::vector<std::string> notes;       ///< what is odd about the file, for a person
};

/// An opened file: `read` appends up to `limit` points to a cleared block and returns how many; 0 is the end.
struct PointSource {
    SourceInfo info;
    std::function<Result<size_t>(PointBlock& block, size_t limit)> read;
};

}  // namespace stipple::lod
