// The full detail of a scene as plain shapes in world space, fp64, and how far a place is from the nearest of them.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/result.h"
#include "engine/render/frame.h"

namespace stipple::study {

struct FullDisc {
    glm::dvec3 centre{0}, normal{0};  ///< normal: unit; 0: none, a ball
    double radius = 0;
};
using FullTriangle = std::array<glm::dvec3, 3>;
/// A segment of a tube. Of a ribbon, too, which lies inside: distances from ribbons may be too small by its half-width.
struct FullTube {
    glm::dvec3 a{0}, b{0};
    double radiusA = 0, radiusB = 0;
};

struct FullShapes {
    std::vector<FullDisc> discs;
    std::vector<FullTriangle> triangles;
    std::vector<FullTube> tubes;
    size_t size() const { return discs.size() + triangles.size() + tubes.size(); }
};

double distanceTo(const FullDisc& disc, const glm::dvec3& place);
double distanceTo(const FullTriangle& triangle, const glm::dvec3& place);
double distanceTo(const FullTube& tube, const glm::dvec3& place);

/// Distances from shapes; world units.
class FullDetail {
  public:
    explicit FullDetail(FullShapes shapes);
    ~FullDetail();
    FullDetail(FullDetail&&) noexcept;
    FullDetail& operator=(FullDetail&&) noexcept;
    /// `limit` where nothing is nearer. From any thread.
    double distance(const glm::dvec3& place, double limit) const;

  private:
    struct Fields;
    std::unique_ptr<Fields> fields_;
};

/// Shapes of the leaves of placed stores; of patches the triangles of their cells, unless `withPatches` is false. Error
/// (budget): more than `most` shapes; (input): a chunk that cannot be read.
Result<FullShapes> leavesOf(std::span<const render::PlacedStore> placed, size_t most, bool withPatches = true);

}  // namespace stipple::study
