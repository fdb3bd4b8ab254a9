// Where the vertices of a mesh store lie. Vertices of a chunk are counted from their group's origin on the lattice,
// which `cell` of its node says in steps of 2^30 (so that 32 bits reach around it); a group that is wider than that has
// coordinates of 64 bits, the upper halves in the second half of each cluster's vertices, and says so by a `stepShift`
// of 1. Stores below 2^30 steps have neither.
#pragma once

#include <array>

#include "lod/store/chunk.h"
#include "lod/store/hierarchy.h"

namespace stipple::lod {

/// Lattices up to this many bits have short vertices, from zero; beyond that they lie around zero.
inline constexpr uint32_t kShortMeshBits = 30;
inline constexpr uint32_t kWideMeshBits = 62;

using MeshPlace = std::array<int64_t, 3>;

/// The node that says how vertices of triangles are counted: their group's. In octrees they are counted from zero.
inline const Node& meshNode(const Hierarchy& h, uint32_t node) {
    static const Node plain;
    return h.isGraph ? h.nodes[node] : plain;
}

/// Lattice point that the vertices of a group are counted from.
inline MeshPlace meshOrigin(const Node& node) {
    MeshPlace origin{};
    for (size_t a = 0; a < 3; ++a)
        origin.at(a) = int64_t{static_cast<int32_t>(static_cast<uint32_t>(node.cell.at(a)))} * (int64_t{1} << 30);
    return origin;
}
inline bool hasPairs(const Node& node) { return node.stepShift != 0; }
/// Vertices of a cluster that triangles name.
inline uint32_t verticesOf(const Node& node, const shared::MeshCluster& cluster) {
    return (cluster.counts & 0xffffu) >> (hasPairs(node) ? 1 : 0);
}

/// Of vertex `i` of a cluster, lattice units.
inline glm::dvec3 vertexPlace(const Node& node, const Chunk& chunk, const shared::MeshCluster& cluster, uint32_t i) {
    const shared::MeshVertex& v = chunk.vertices[cluster.firstVertex + i];
    const MeshPlace from = meshOrigin(node);
    MeshPlace to{v.x, v.y, v.z};
    if (hasPairs(node)) {
        const shared::MeshVertex& high = chunk.vertices[cluster.firstVertex + i + verticesOf(node, cluster)];
        to = {int64_t{high.x} * (int64_t{1} << 32) + static_cast<uint32_t>(v.x),
              int64_t{high.y} * (int64_t{1} << 32) + static_cast<uint32_t>(v.y),
              int64_t{high.z} * (int64_t{1} << 32) + static_cast<uint32_t>(v.z)};
    }
    return {static_cast<double>(from[0] + to[0]), static_cast<double>(from[1] + to[1]),
            static_cast<double>(from[2] + to[2])};
}

}  // namespace stipple::lod
