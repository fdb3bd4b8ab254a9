// Blocks of elevation patches in fp64, from the description of the format alone: samples over a plane, two triangles a
// cell.
#pragma once

#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "engine/reference/decode.h"
#include "lod/primitives/patch_blocks.h"
#include "shaders/shared/material.h"

namespace stipple::reference {

/// Metallic and roughness: a byte each, low and high; of what has no material, 0 and 1.
inline glm::dvec2 finishOf(uint32_t material) {
    if (material >= 65536) return {0, 1};
    return glm::dvec2(material % 256, material / 256) / 255.0;
}

struct PatchCorner {
    glm::dvec3 place{0};   ///< lattice steps
    glm::dvec3 normal{0};  ///< the store's axes
    glm::dvec3 colour{0};  ///< linear
};

class PatchBlockReader {
  public:
    PatchBlockReader(const lod::Hierarchy& h, const lod::Node& node, const shared::PatchBlock& block,
                     const lod::PatchPlane& plane)
        : block_(block), plane_(plane), frame_(glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)))) {
        const double cell = std::ldexp(1.0, static_cast<int>(h.rootLog2) - node.level);
        origin_ = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * cell + plane.origin;
    }
    /// From (i, j, height), counted from the block's first sample, to lattice steps.
    glm::dvec3 lattice(const glm::dvec3& at) const {
        const double step = plane_.step;
        return origin_ + frame_ * glm::dvec3(step * (block_.place % 65536 + at.x), step * (block_.place / 65536 + at.y),
                                             std::ldexp(at.z, plane_.quantumExponent));
    }
    glm::dvec3 normalOnPlane(uint32_t s) const { return decodeDirection(block_.normals[s]); }
    /// Sample 17 v + u of the block.
    PatchCorner sample(uint32_t s) const {
        const uint32_t colour = block_.colours[s];
        return {lattice({s % 17, s / 17, code(s)}), frame_ * normalOnPlane(s),
                glm::dvec3(decodeSrgb(colour % 256), decodeSrgb(colour / 256 % 256), decodeSrgb(colour / 65536 % 256))};
    }
    /// From the directions of the patch to those of the store.
    glm::dvec3 inStore(const glm::dvec3& direction) const { return frame_ * direction; }
    /// Are the cells left and right of a sample, below and above, drawn by the block?
    using CellsAround = std::array<std::array<bool, 2>, 2>;
    /// Calls use(s, cells) with samples that have one.
    template <typename Use>
    void forEachDisc(const Use& use) const {
        const auto isDrawn = [&](int i, int j) {
            const int cell = 16 * j + i;
            return i >= 0 && i < 16 && j >= 0 && j < 8 &&
                   (block_.cells[static_cast<size_t>(cell / 32)] >> (cell % 32) & 1u) != 0;
        };
        for (int s = 0; s < 153; ++s) {
            const int i = s % 17, j = s / 17;
            const CellsAround cells{{{isDrawn(i - 1, j - 1), isDrawn(i - 1, j)}, {isDrawn(i, j - 1), isDrawn(i, j)}}};
            if (cells[0][0] || cells[0][1] || cells[1][0] || cells[1][1]) use(static_cast<uint32_t>(s), cells);
        }
    }
    /// Calls use(a, b, c) with samples.
    template <typename Use>
    void forEachTriangle(const Use& use) const {
        for (uint32_t cell = 0; cell < 128; ++cell) {
            if ((block_.cells[cell / 32] >> (cell % 32) & 1u) == 0) continue;
            const uint32_t s = 17 * (cell / 16) + cell % 16;
            const std::array<uint8_t, 6>& t = lod::cellTriangles(code(s), code(s + 1), code(s + 17), code(s + 18));
            const auto corner = [&](size_t k) { return s + t.at(k) % 2 + 17 * (t.at(k) / 2u); };
            use(corner(0), corner(1), corner(2));
            use(corner(3), corner(4), corner(5));
        }
    }

  private:
    int code(uint32_t s) const { return static_cast<int>(block_.heights[s / 2] / (s % 2 == 0 ? 1u : 65536u) % 65536); }

    const shared::PatchBlock& block_;
    const lod::PatchPlane& plane_;
    glm::dmat3 frame_;
    glm::dvec3 origin_{0};
};

/// What patches are made of: nothing but what their corners say.
inline const shared::SurfaceMaterial kPatchMaterial = [] {
    shared::SurfaceMaterial m{};
    m.baseColour = {1, 1, 1};
    m.metallic = m.roughness = m.alpha = 1;
    return m;
}();

}  // namespace stipple::reference
