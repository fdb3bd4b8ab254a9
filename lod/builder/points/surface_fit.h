// What the neighbours of a point say of the surface there: how they are spread, and how far it is to the middle of the
// gaps between them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "engine/base/lanes.h"

namespace stipple::lod {

/// Neighbourhood of neighbours, parallel; each with room for whole vectors of kLanes (behind the last: any finite
/// numbers).
struct Neighbours {
    const float *x, *y, *z;
    size_t count;
};

/// Neighbours as they are found.
struct Neighbourhood {
    std::vector<float> x, y, z;  ///< whole vectors
    size_t count = 0;
    void resize(size_t n) {
        count = n;
        if (x.size() < n + kLanes)
            for (auto* axis : {&x, &y, &z}) axis->resize(2 * n + kLanes);
    }
    void add(const glm::vec3& p) {
        resize(count + 1);
        x[count - 1] = p.x;
        y[count - 1] = p.y;
        z[count - 1] = p.z;
    }
    Neighbours neighbours() const { return {x.data(), y.data(), z.data(), count}; }
};

/// Variances along the axes of least, middle and largest spread, about the mean.
struct Spread {
    size_t points = 0;
    double least = 0, middle = 0, most = 0;
    glm::vec3 normal{0}, along{0};  ///< unit vectors; zero: none found
    /// Do the points lie along a line, as far as can be told? So it is where the second variance is a fiftieth of the
    /// first, or at most `slim` of it and not much more than the third (a line with noise), or what rounding alone
    /// makes (`rounding`: variance of that, same units). A line has no normal.
    bool isLine(double rounding, double slim) const;
    /// Thicker than a surface that bends by that much: `share` of the second variance.
    bool isThick(double share) const { return least > share * middle; }
};

/// Of those whose squared distances from `from` (bits of floats, whole vectors, see squaredDistances) are at most
/// `reach`. In two passes: first the mean, then the products of what differs from it.
Spread spreadOf(const Neighbours& all, const float (&from)[3], const int32_t* squared, float reach);

inline constexpr size_t kDirections = 16;
/// For kDirections in a plane through `from`, evenly around it from `axis` on to `across` (unit vectors): the inverse
/// of twice the distance to where the plane belongs to a neighbour instead, 0 if it never does. Neighbours are turned
/// into the plane for that, each as far from `from` as it is: of one at d, whose foot in the plane is f, the value is
/// dot(f, direction) / (|f| |d|). (As they stand, the plane would be theirs from up to 1.41 times as far on, where the
/// surface bends, and discs that much wider.) Those more than 45 degrees over it do not count. That is the support
/// function of the neighbours after inversion in the unit sphere, its least values the corners of the Voronoi cell.
/// Distances above `most` are of no interest: what comes for them is too small, or 0.
std::array<float, kDirections> inverseExtents(const Neighbours& all, const float (&from)[3], const glm::vec3& axis,
                                              const glm::vec3& across, float most);

/// The distance to the farthest corner of the Voronoi cell that is not farther than `most`: a disc of it and those of
/// the neighbours leave no gap. What is farther is no gap between neighbours but an edge of the surface; so is a corner
/// between two neighbours that are both nearer than itself, but where points are much nearer along lines than across
/// (`isUneven`). 0: no corner.
float farthestCorner(const std::array<float, kDirections>& inverse, float most, bool isUneven);

}  // namespace stipple::lod
