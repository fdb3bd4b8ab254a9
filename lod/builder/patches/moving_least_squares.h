// Where a line across a plane meets the surface of points, by moving least squares (Ochotta & Saupe 2004; Alexa et al.
// 2003), guarded so that nothing comes out between two sheets.
//
// The points of one sheet around a place p are fitted by a height over the plane, quadratic where there are enough of
// them on all sides, else linear, with weights exp(-(d^2 - dmin^2) / h^2) of their distance d from p; p moves to the
// fit, at most ten times, until it moves by less than 1e-4 h. What moves farther than h, does not come to rest, is
// steeper than 75 degrees, has its points on one side only (beyond the border) or far from the fit is no result.
#pragma once

#include <array>
#include <span>

#include "lod/builder/patches/point_surface.h"

namespace stipple::lod {

struct LeastSquaresSample {
    double height = 0;          ///< along the axis, from the place that was asked about; scene units
    glm::dvec2 slope{0};        ///< of the height, along U and V
    double nearest = 0;         ///< distance of the nearest of the points that were used from the place, scene units
    uint32_t nearestPoint = 0;  ///< which that is
    glm::vec3 colour{0};        ///< linear
};

/// Where to look for what lies around places near each other.
class PlacesNear {
  public:
    /// `guides`: of each place, the point whose sheet it is.
    PlacesNear(const PointSurface& surface, std::span<const glm::dvec3> places, std::span<const uint32_t> guides);
    const PointSurface& surface() const { return surface_; }
    /// The nearest points to one of the places, as far as is usual or, where those are too few, farther.
    void find(const glm::dvec3& place, uint32_t guide, bool isFar, NearPoints::Found& near);

  private:
    static constexpr size_t kReaches = 2;
    const PointSurface& surface_;
    glm::dvec3 lo_{1e300}, hi_{-1e300};
    float spacing_ = 0;  ///< the greatest of the guides'
    std::array<bool, kReaches> isKnown_{};
    std::array<NearPoints::Runs, kReaches> runs_;
};

/// At `place`, along the third column of `frame`. False: no result.
bool leastSquaresAt(PlacesNear& places, const glm::dvec3& place, const glm::dmat3& frame, uint32_t guide,
                    LeastSquaresSample& sample);

}  // namespace stipple::lod
