// Coarser versions of one small part of a mesh, and which of them a group takes.
#pragma once

#include "lod/builder/mesh/mesh_work.h"

namespace stipple::lod {

/// Where a part lies: its centre, its longest axis, and how long the shortest is beside that.
struct PartShape {
    glm::dvec3 centre{0}, axis{1, 0, 0};
    double thickness = 1;
};
/// Of the corners of `indices`.
PartShape shapeOf(const std::vector<uint32_t>& indices, const LocalMesh& local);
/// What is thicker (PartShape::thickness) is a body, not a leaf or a twig.
constexpr double kThickPart = 0.2;

/// Triangles in place of those of a part.
struct PartVersion {
    std::vector<uint32_t> indices;  ///< local, corners of the part
    float cost = 0;                 ///< lattice units: about how far it is from the part, both ways
};
/// From fine to coarse, each dearer than the one before; the part itself is the first.
/// `shape`: shapeOf(part).
std::vector<PartVersion> versionsOf(const std::vector<uint32_t>& part, const PartShape& shape, const LocalMesh& local,
                                    bool isTwoSided);

/// For each part the version to take, so that all have about `target` indices or fewer at the least largest cost.
std::vector<uint32_t> chooseVersions(const std::vector<std::vector<PartVersion>>& parts, size_t target);

}  // namespace stipple::lod
