// The plane of a patch on its way, and what is found over it before heights become codes.
#pragma once

#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "lod/primitives/patch.h"

namespace stipple::lod {

struct HeightGrid {
    static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    glm::dvec3 origin{0};
    glm::quat turn{1, 0, 0, 0};
    glm::dmat3 frame{1};  ///< of `turn`
    double step = 1;
    uint32_t width = 0, height = 0;  ///< samples
    std::vector<double> heights;     ///< scene units above the plane; kNone
    std::vector<glm::vec3> normals;  ///< of the scene
    std::vector<uint32_t> colours;
    std::vector<uint8_t> materials;
    bool hasFineNormals = false;  ///< rounded to 0.03 degrees instead of 0.12: of what is a mirror
    std::vector<uint8_t> cells;

    size_t at(uint32_t i, uint32_t j) const { return size_t{j} * width + i; }
    size_t cell(uint32_t i, uint32_t j) const { return size_t{j} * (width - 1) + i; }
    std::array<size_t, 4> corners(uint32_t i, uint32_t j) const {
        const size_t s = at(i, j);
        return {s, s + 1, s + width, s + width + 1};
    }
    bool has(size_t sample) const { return heights[sample] == heights[sample]; }
    /// Samples along U and V, scene units along N.
    glm::dvec3 local(const glm::dvec3& p) const {
        const glm::dvec3 q = glm::transpose(frame) * (p - origin);
        return {q.x / step, q.y / step, q.z};
    }
};

/// Of places (scene units) over a plane across `axis`: axes along their extent, `margin` cells around them. False where
/// that takes more than `mostSamples`, or more than Patch::kMostSide along a side.
bool planGrid(size_t count, const std::function<glm::dvec3(size_t)>& place, const glm::dvec3& axis, double step,
              uint32_t margin, size_t mostSamples, HeightGrid& grid);

/// Heights as codes, rounded to the nearest; samples beside no cell are dropped, empty rows and columns cut away.
Patch toPatch(const HeightGrid& grid);

/// Heights of a patch (scene units above its plane) at any place over its cells.
class PatchHeights {
  public:
    explicit PatchHeights(const Patch& patch)
        : patch_(patch), toLocal_(glm::transpose(patch.frame())), quantum_(patch.quantum()) {}
    glm::dvec3 local(const glm::dvec3& p) const {
        const glm::dvec3 q = toLocal_ * (p - patch_.origin);
        return {q.x / double{patch_.step}, q.y / double{patch_.step}, q.z};
    }
    /// kNone where there is no cell. `slope`: of the height, scene units a sample, along U and V.
    double at(double u, double v, glm::dvec2* slope = nullptr) const;

  private:
    const Patch& patch_;
    glm::dmat3 toLocal_;
    double quantum_;
};

}  // namespace stipple::lod
