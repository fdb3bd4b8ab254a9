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
    uint8_t material = 0;
    uint32_t light = 0;  ///< PatchMap::light; discs of stores have it in their colour
};

/// One disc about the mean of those in a cubic cell of that edge, or of larger ones where that leaves more than `most`;
/// each reaches around all that it stands for. In the order of the cells. Returns the largest radius.
double uniteDiscs(std::vector<LeftDisc>& discs, double edge, size_t most = ~size_t{0});

}  // namespace stipple::lod
