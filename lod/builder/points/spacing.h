// How near to each other the points of a build lie, from a sample of their places.
#pragma once

#include <glm/glm.hpp>
#include <vector>

namespace stipple::lod {

/// The spacing where points lie densest, but for one place in a hundred: the share of a sample that lies in small dense
/// objects, however far apart, is not more than that. `places`: different ones (beyond 2^-50 of their coordinates),
/// each of a point with probability `share` whatever the others; on surfaces. 0: too few to tell.
double denseSpacing(std::vector<glm::dvec3> places, double share);

/// The largest extent along an axis of what lies between the 2nd and the 98th percentile of `places`; 0: of none.
double denseExtent(const std::vector<glm::dvec3>& places);
/// Likewise the largest distance from zero along an axis.
double denseDistance(const std::vector<glm::dvec3>& places);

/// What lies within twice that extent of the median along each axis.
struct DenseBox {
    glm::dvec3 middle{0}, lo{0}, hi{0};
};
DenseBox denseBox(const std::vector<glm::dvec3>& places);

}  // namespace stipple::lod
