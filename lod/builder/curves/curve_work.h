// What the stages of a curve build hand to each other. Lengths are lattice units.
#pragma once

#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <vector>

#include "lod/builder/octree/bytes.h"
#include "lod/builder/octree/frame.h"
#include "lod/primitives/curves.h"

namespace stipple::lod {

/// A vertex of a curve, long segments divided; the same in every cell that it belongs to.
struct CurvePoint {
    glm::dvec3 p{0};
    float radius = 0;
    glm::vec3 direction{0};          ///< unit: across a ribbon, along a tube
    uint32_t curve = 0, number = 0;  ///< number: along the curve
    uint32_t colour = 0;             ///< sRGB
    uint32_t isRibbon = 0;
    bool isFarFromAll = false;  ///< no vertex of the source: see CurveDivision; known where leaves are made
};

/// Part of a curve between two points, at some level of detail.
struct CurvePart {
    uint32_t a = 0, b = 0;  ///< points
    uint32_t colourA = 0, colourB = 0;
    float radiusA = 0, radiusB = 0;  ///< of its own: what it stands for has the same area
    double error = 0;                ///< bound of the distance from what it stands for
    uint8_t ownCode = 0, parentCode = 255;
    uint8_t octants = 0;
    std::array<uint8_t, 5> unused{};
};

struct CurveLevel {
    double tolerance = 0;  ///< error that merging may add
    double rounding = 0;   ///< of positions
    double thin = 0;       ///< radius of curves that are, at most
    size_t mostParts = 0;  ///< beyond that, thin curves are pruned
};

/// One node's parts from its children's, sorted along the curves. `standsFor[i]`: the part that child part i became,
/// kPruned where others stand for it.
inline constexpr uint32_t kPruned = ~0u;
struct CurveMerge {
    std::vector<CurvePart> parts;
    std::vector<uint32_t> standsFor;
    double kept = 1;         ///< share of the thin curves' area that was drawn
    double commonError = 0;  ///< of all thin parts, where some were
};
CurveMerge mergeParts(const std::vector<CurvePoint>& points, const std::vector<CurvePart>& children,
                      const CurveLevel& level);

/// A point as it travels, with no more bits than matter: places to a quarter of a lattice unit (2^-26 of the extent, or
/// finer where curves lie far from each other),
/// directions to 0.06 degrees, radii to 2^-17 of themselves.
struct TravellingPoint {
    static constexpr uint32_t kStepBits = 2;
    uint32_t x = 0, y = 0, z = 0;
    float radius = 0;
    uint32_t direction = 0, colour = 0;
    uint64_t high = 0;  ///< see Place
    TravellingPoint() = default;
    explicit TravellingPoint(const CurvePoint& p);
    CurvePoint point() const;
    /// In steps of a quarter of a lattice unit.
    Place steps() const { return placeOf(x, y, z, high); }
    /// Lattice coordinates of the middle of a segment.
    static Place middle(const Place& a, const Place& b) {
        constexpr uint32_t kShift = kStepBits + 1;
        return {(a[0] + b[0]) >> kShift, (a[1] + b[1]) >> kShift, (a[2] + b[2]) >> kShift};
    }
    static Place middle(const TravellingPoint& a, const TravellingPoint& b) { return middle(a.steps(), b.steps()); }
    /// Largest distance from where the point was, lattice units.
    static double rounding() { return std::exp2(-1.0 - kStepBits) * std::sqrt(3.0); }
};

/// Successive points of one curve as its source has them; numbers count the ends of divided segments.
struct CurveRun {
    uint32_t curve = 0, firstNumber = 0, points = 0, isRibbon = 0;
};
/// Runs of leaf segments as bytes.
struct CurveRuns {
    std::vector<CurveRun> runs;
    std::vector<TravellingPoint> points;  ///< of all runs
    void put(ByteWriter& to) const;
    /// Appends; false if the bytes are not what put wrote.
    bool get(ByteReader& from);
};

}  // namespace stipple::lod
