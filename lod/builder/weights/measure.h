// Weights of surfels, measured on the surface itself: what kernels add up to at each of their centres (Ren, Pfister &
// Zwicker 2002, 7.2, measure it on pictures from many sides).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace stipple::lod {

/// As drawn in mode ewa.
struct Surfel {
    glm::vec3 place{0};   ///< any unit, about any origin
    glm::vec3 normal{0};  ///< unit; zero: none
    float radius = 0;     ///< of the opaque part (shaders/shared/ewa.h), the same unit
    bool isTwoSided = false;
    bool isLeaf = false;
};

/// The weight of each: as those of a square grid have gridWeight(2), sum(weight x kernel) at every centre is about what
/// it is at a grid's (0.97; its mean over the grid is 1). Three rounds, each dividing a surfel's weight by what is
/// found at its centre. Only surfels that face alike (by 60 degrees) and lie within what a surface is thick count.
/// Those near the end of the given ones are missing neighbours: give more than you want to know of.
std::vector<float> surfelWeights(std::span<const Surfel> surfels);

/// The byte that surfelWeight makes the weight of; at least 1.
uint8_t weightCode(float weight);

}  // namespace stipple::lod
