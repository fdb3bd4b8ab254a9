// Triangles in the cells of an even grid, for distances of points from the nearest one. Those of a cell lie side by
// side, and eight are looked at at once.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::lod {

class TriangleGrid {
  public:
    /// Both outlive this. `wantsEach`: inBall() will be asked.
    TriangleGrid(const std::vector<glm::vec3>& position, const std::vector<uint32_t>& indices, bool wantsEach);

    const glm::vec3& corner(uint32_t t, size_t k) const { return position_[indices_[3 * size_t{t} + k]]; }
    /// In the units of the positions; so are all distances here.
    float distance(const glm::vec3& p, uint32_t t) const;

    /// The least distance() of the triangles that reach into a ball of that radius, to the bit; one that is not more
    /// than `enough` may be that of another triangle. `hint`: one that is probably not far.
    float leastDistance(const glm::vec3& p, uint32_t hint, float enough = 0) const;

    /// Of all cells together: triangles that stand in several count several times.
    size_t items() const { return items_.size(); }

    /// Calls isEnough(triangle) for all that may be nearer to p than `limit`, which it lowers, until it says that it
    /// has seen enough; some are visited twice.
    template <typename Visit>
    void inBall(const glm::vec3& p, const float& limit, const Visit& isEnough) const {
        const auto row = [&](int x0, int x1, int y, int z) {
            const uint32_t last = start_[number(x1, y, z) + 1];
            for (uint32_t i = start_[number(x0, y, z)]; i < last; ++i)
                if (isNear(p, items_[i], limit) && isEnough(items_[i])) return true;
            return false;
        };
        // What lies in the same cell first: the ball is much smaller afterwards.
        const glm::ivec3 own = cellOf(p);
        if (row(own.x, own.x, own.y, own.z)) return;
        const glm::ivec3 from = cellOf(p - limit), to = cellOf(p + limit);
        if (from == to) return;
        for (int z = from.z; z <= to.z; ++z)
            for (int y = from.y; y <= to.y; ++y)
                if (row(from.x, to.x, y, z)) return;
    }

    /// Corners a, b, c of one triangle after the other: x, y, z of a, then of b, then of c.
    using Columns = std::array<std::vector<float>, 9>;

  private:
    /// Can any point of triangle t be nearer than `limit`?
    bool isNear(const glm::vec3& p, uint32_t t, float limit) const {
        const glm::vec4& s = spheres_[t];
        const glm::vec3 d = p - glm::vec3(s);
        const float reach = limit + s.w;
        return glm::dot(d, d) < reach * reach;
    }
    glm::ivec3 cellOf(const glm::vec3& p) const {
        // (Before it is whole: a ball may be larger than integers are, and then begins in the first cell.)
        return glm::ivec3(glm::clamp((p - lo_) * perCell_, glm::vec3(0), glm::vec3(size_ - 1)));
    }
    size_t number(int x, int y, int z) const {
        return (static_cast<size_t>(z) * static_cast<size_t>(size_.y) + static_cast<size_t>(y)) *
                   static_cast<size_t>(size_.x) +
               static_cast<size_t>(x);
    }
    void chooseCells(const glm::vec3& lo, const glm::vec3& hi, float edge);
    glm::ivec3 firstCell(uint32_t t) const;
    glm::ivec3 lastCell(uint32_t t) const;
    /// Least distance from the triangles of the cells x0 to x1, and perhaps from others.
    float leastInRow(const glm::vec3& p, int x0, int x1, int y, int z) const;
    void placeItems();
    void makeSpheres();

    const std::vector<glm::vec3>& position_;
    const std::vector<uint32_t>& indices_;
    glm::vec3 lo_{0};
    float edge_ = 1, perCell_ = 1;
    glm::ivec3 size_{1};
    std::vector<uint32_t> start_, items_;  ///< of each cell where its triangles begin; their numbers
    Columns columns_;                      ///< of the items
    std::vector<glm::vec4> spheres_;       ///< of each triangle: centre, radius
};

}  // namespace stipple::lod
