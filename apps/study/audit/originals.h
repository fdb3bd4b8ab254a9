// What a store of points keeps of the points that it was built from: places (their rounding), normals and colours
// (their codes), against the file itself, point by point. Of the store only leaf records are looked at, decoded in
// fp64.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "engine/base/result.h"
#include "lod/store/store.h"

namespace stipple::study {

/// As a file has them: all parallel, or empty where it has none.
struct Originals {
    std::vector<glm::dvec3> place;
    std::vector<glm::dvec3> normal;  ///< unit; zero: this one has none
    std::vector<std::array<uint8_t, 3>> colour;
};
/// Error (budget): more than `most`; (input): it cannot be read, or is no file of points.
Result<Originals> readOriginals(const std::string& path, size_t most);

/// Of normals as stores keep them (11 bits a coordinate, README), degrees.
inline constexpr double kNormalDegrees = 0.12;

struct KeptAudit {
    uint64_t points = 0, records = 0;  ///< of the file; leaf records of the store
    uint64_t placeBeyond = 0;          ///< points without a record within what their leaf rounds by
    uint64_t normals = 0, normalBeyond = 0;
    uint64_t colours = 0, colourBeyond = 0;  ///< unlike in any bit
    double worstRounding = 0;                ///< world units
    double statedRounding = 0;               ///< the greatest that a leaf has, world units
    double worstNormal = 0;                  ///< degrees
    uint64_t beyond() const { return placeBeyond + normalBeyond + colourBeyond; }
};
/// Every point is looked for among the records within the rounding of their leaf (half a step along each axis, and that
/// of the lattice); of several there the one most like it counts.
Result<KeptAudit> auditOriginals(const Originals& originals, const lod::Store& store);

}  // namespace stipple::study
