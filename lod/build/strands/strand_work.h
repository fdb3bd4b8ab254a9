// What the stages of a strand build hand to each other. Lengths are lattice units.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "lod/strands.h"

namespace stipple::lod {

struct StrandPoint {
    glm::dvec3 p{0};
    float radius = 0;
    glm::vec3 direction{0};  ///< unit: across a ribbon, along a tube
    uint32_t strand = 0;
    double along = 0;  ///< number in the strand; between two vertices where a segment was divided
};

/// Part of a strand between two points, at some level of detail.
struct StrandPart {
    uint32_t a = 0, b = 0;  ///< points
    uint32_t colourA = 0, colourB = 0;
    float radiusA = 0, radiusB = 0;  ///< of its own: what it stands for has the same area
    double error = 0;                ///< bound of the distance from what it stands for
    uint8_t ownCode = 0, parentCode = 255;
    uint8_t octants = 0;
};

struct StrandLevel {
    double tolerance = 0;  ///< error that merging may add
    double rounding = 0;   ///< of positions
    size_t mostParts = 0;  ///< beyond that, thin strands are drawn by lot
};

/// One node's parts from its children's, sorted along the strands. `standsFor[i]`: the part that child part i became,
/// kDrawnByLot where others stand for it.
inline constexpr uint32_t kDrawnByLot = ~0u;
struct StrandMerge {
    std::vector<StrandPart> parts;
    std::vector<uint32_t> standsFor;
    double kept = 1;         ///< share of the thin strands' area that was drawn
    double commonError = 0;  ///< of all thin parts, where some were
};
StrandMerge mergeParts(const std::vector<StrandPoint>& points, const std::vector<uint8_t>& isRibbon,
                       const std::vector<StrandPart>& children, const StrandLevel& level);

}  // namespace stipple::lod
