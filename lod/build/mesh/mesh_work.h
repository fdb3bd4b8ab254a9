// What the stages of a mesh build hand to each other.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

#include "engine/base/executor.h"
#include "lod/mesh.h"
#include "lod/store.h"

namespace stipple::lod {

/// Welded input on its lattice. Level-of-detail triangles index the same vertices.
struct WeldedMesh {
    glm::dvec3 origin{0};  ///< world position of lattice (0,0,0)
    double unit = 1;       ///< world units per step; coordinates are below 2^24, so that fp32 holds them exactly
    std::vector<shared::MeshVertex> vertices;
    std::vector<uint32_t> position;  ///< vertex -> number of its position: seams of attributes do not part a surface
    std::vector<uint32_t> indices;   ///< 3 a triangle, along a Morton curve
    uint64_t degenerate = 0, duplicate = 0, notFinite = 0;
    double rounding = 0;  ///< largest rounding of a coordinate, world units

    glm::vec3 at(uint32_t vertex) const {
        const shared::MeshVertex& v = vertices[vertex];
        return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
    }
};

WeldedMesh weldMesh(TriangleMesh mesh, Executor& executor);

constexpr uint32_t kNoProducer = ~0u;

struct Cluster {
    std::vector<uint32_t> indices;  ///< 3 a triangle, into WeldedMesh::vertices
    uint32_t producer = kNoProducer;
};

/// Vertices of a list of triangles, numbered from 0.
struct LocalMesh {
    std::vector<uint32_t> global;   ///< local -> WeldedMesh vertex
    std::vector<uint32_t> indices;  ///< local
    std::vector<glm::vec3> position;
};
LocalMesh makeLocal(const WeldedMesh& mesh, const std::vector<const Cluster*>& clusters);

/// Cuts triangles into clusters of at most kClusterTriangles and kClusterVertices. Where they stand along a curve that
/// fills space, runs of them are compact as they are, at a fraction of the time.
void appendClusters(const LocalMesh& local, const std::vector<uint32_t>& indices, uint32_t producer, bool isAlongCurve,
                    std::vector<Cluster>& out);
std::vector<Cluster> makeClusters(const WeldedMesh& mesh, Executor& executor);

/// Groups of about `size` clusters with few edges between groups; deterministic.
std::vector<std::vector<uint32_t>> groupClusters(const WeldedMesh& mesh, const std::vector<Cluster>& clusters,
                                                 uint32_t size, Executor& executor);

/// Lattice units: the distance between the surface of `local` and its simplification, both ways, and how far a texture
/// is shifted along it where `mesh` is textured. Not below `unimportant`, which saves looking closer.
double measureDeviation(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& coarse,
                        double unimportant);

/// Writes all levels of all textures and fills the tables of `h`.
Result<void> writeTextures(const std::vector<TextureImage>& images, StoreWriter& writer, Hierarchy& h,
                           Executor& executor);

}  // namespace stipple::lod
