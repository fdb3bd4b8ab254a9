// Where long segments are divided, so that each piece fits the octree cell that it lies in.
#pragma once

#include <vector>

#include "lod/builder/curves/curve_work.h"
#include "lod/builder/octree/frame.h"

namespace stipple::lod {

/// Even pieces no longer than the smallest cells; of a segment that would be too many of those, pieces that grow with
/// the distance from all vertices: octree cells are small only where vertices are. Part of the segments of a curve can
/// be divided anywhere with the same result.
class CurveDivision {
  public:
    /// Even pieces at most; those that are left in place of more, about.
    static constexpr double kMostEven = 1 << 14, kGraded = 256;

    CurveDivision() = default;
    /// `vertices`: keys in `frame` of vertices from everywhere, sorted.
    CurveDivision(const Frame& frame, std::vector<Key> vertices) : frame_(frame), vertices_(std::move(vertices)) {}

    /// Longest even piece, lattice units: ends are rounded, and the piece is to fit all the same.
    static double longest(double cell) { return cell - 1; }
    /// How many pieces a segment of this length becomes, about.
    static double pieces(double length, double cell) {
        const double even = std::max(1.0, std::ceil(length / longest(cell)));
        return even > kMostEven ? kGraded : even;
    }

    /// The ends of the pieces of a segment, `b` the last. Returns whether they grow.
    bool divide(const TravellingPoint& a, const TravellingPoint& b, std::vector<TravellingPoint>& ends) const;
    const std::vector<Key>& vertices() const { return vertices_; }

  private:
    /// Length of a piece that begins at `p`, as far as vertices are concerned.
    double reachAt(const glm::dvec3& p) const;
    bool isEmpty(const Place& cell, uint32_t up) const;

    Frame frame_;
    std::vector<Key> vertices_;
};

}  // namespace stipple::lod
