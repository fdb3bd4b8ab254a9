// What no patch stands for: discs.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

namespace stipple::lod {

/// A place that no patch stands for.
struct LeftDisc {
    glm::dvec3 place{0};  ///< lattice units
    glm::vec3 normal{0};
    float radius = 0;  ///< lattice units
    uint32_t colour = 0;
};

/// One disc about the mean of those in a cubic cell of that edge, that reaches around all of them; in the order of the
/// cells. Returns the largest radius.
double uniteDiscs(std::vector<LeftDisc>& discs, double edge);

}  // namespace stipple::lod
