// How far a place is from the nearest of many triangles, in fp64.
#pragma once

#include "tests/support/meshes.h"

namespace stipple::test {

class TriangleField {
  public:
    explicit TriangleField(std::vector<Triangle> triangles);
    /// World units; `limit` where none is nearer.
    double distance(const glm::dvec3& place, double limit) const;

  private:
    struct Node {
        glm::dvec3 lo{0}, hi{0};
        uint32_t begin = 0, end = 0, left = 0;  ///< left: 0 at leaves; the other child follows it
    };
    void split(uint32_t node);

    std::vector<Triangle> triangles_;
    std::vector<Node> nodes_;
};

}  // namespace stipple::test
