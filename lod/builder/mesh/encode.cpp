// The chunk of a group.
#include <cmath>

#include "lod/builder/mesh/encode.h"

namespace stipple::lod {
namespace {

/// Which textures the group shows, what part of them, and how densely.
void describeTextures(const MeshBuildSettings& settings, const Chunk& chunk, Group& group) {
    constexpr float kAll = 1e6f;
    std::vector<uint8_t> isUsed(settings.textures.size());
    glm::vec2 lo(kAll), hi(-kAll);
    const auto& materials = settings.description.materials;
    for (const shared::MeshVertex& v : chunk.vertices) {
        if ((v.surface & shared::kSurfaceTextured) == 0) continue;
        lo = glm::min(lo, glm::vec2(v.u, v.v));
        hi = glm::max(hi, glm::vec2(v.u, v.v));
        const uint32_t m = v.surface & shared::kSurfaceMaterialMask;
        if (m >= materials.size()) continue;
        for (const shared::TextureSlot* s :
             {&materials[m].baseTexture, &materials[m].surfaceTexture, &materials[m].normalTexture,
              &materials[m].occlusionTexture, &materials[m].emissiveTexture}) {
            if (s->texture == 0) continue;
            isUsed[s->texture - 1] = 1;
            const bool isPlain = s->rowU.x == 1 && s->rowU.y == 0 && s->rowU.z == 0 && s->rowV.x == 0 &&
                                 s->rowV.y == 1 && s->rowV.z == 0;
            if (!isPlain) {
                lo = glm::vec2(-kAll);
                hi = glm::vec2(kAll);
            }
        }
    }
    double inSpace = 0, inTexture = 0;
    for (const shared::MeshCluster& c : chunk.clusters)
        for (uint32_t t = c.firstTriangle; t < c.firstTriangle + (c.counts >> 16); ++t) {
            const auto vertex = [&](uint32_t k) -> const shared::MeshVertex& {
                return chunk.vertices[c.firstVertex + (chunk.triangles[t] >> (8 * k) & 255u)];
            };
            const auto place = [&](uint32_t k) {
                return vertexPlace(group.node, chunk, c, chunk.triangles[t] >> (8 * k) & 255u);
            };
            const auto &a = vertex(0), &b = vertex(1), &d = vertex(2);
            if ((a.surface & shared::kSurfaceTextured) == 0) continue;
            inSpace += glm::length(glm::cross(place(1) - place(0), place(2) - place(0)));
            inTexture += std::abs(double(b.u - a.u) * (d.v - a.v) - double(b.v - a.v) * (d.u - a.u));
        }
    for (uint32_t t = 0; t < isUsed.size(); ++t)
        if (isUsed[t]) group.textures.push_back(t);
    if (group.textures.empty()) return;
    group.counts.lowU = lo.x;
    group.counts.lowV = lo.y;
    group.counts.highU = hi.x;
    group.counts.highV = hi.y;
    group.counts.uvPerStep = inSpace > 0 ? static_cast<float>(std::sqrt(inTexture / inSpace)) : 0.0f;
}

/// Of a wide lattice: where the group's vertices are counted from, and whether 32 bits do.
void countFromOrigin(const WeldedMesh& mesh, const std::vector<const Cluster*>& members, Node& node) {
    Steps lo = mesh.at(members[0]->indices[0]), hi = lo;
    for (const Cluster* c : members)
        for (const uint32_t v : c->indices) {
            lo = glm::min(lo, mesh.at(v));
            hi = glm::max(hi, mesh.at(v));
        }
    constexpr int64_t kEdge = int64_t{1} << 30, kHalf = kEdge / 2;
    const Steps size = hi - lo, middle = (lo + hi) >> int64_t{1};
    if (std::max({size.x, size.y, size.z}) > kEdge) {
        node.stepShift = 1;  // pairs
        return;
    }
    for (int a = 0; a < 3; ++a) node.cell.at(static_cast<size_t>(a)) = static_cast<uint32_t>((middle[a] + kHalf) >> 30);
}

/// Appends the vertices of a cluster; of pairs then their upper halves.
void appendVertices(const WeldedMesh& mesh, const std::vector<uint32_t>& order, const Node& node, Chunk& chunk) {
    const MeshPlace origin = meshOrigin(node);
    for (const uint32_t v : order) {
        shared::MeshVertex vertex = mesh.vertex(v);
        if (mesh.isWide() && !hasPairs(node)) {
            const Steps at = mesh.at(v);
            vertex.x = static_cast<int>(at.x - origin[0]);
            vertex.y = static_cast<int>(at.y - origin[1]);
            vertex.z = static_cast<int>(at.z - origin[2]);
        }
        chunk.vertices.push_back(vertex);
    }
    for (size_t i = 0; hasPairs(node) && i < order.size(); ++i) {
        const glm::ivec3& high = mesh.vertices.high[order[i]];
        shared::MeshVertex vertex{};
        vertex.x = high.x;
        vertex.y = high.y;
        vertex.z = high.z;
        chunk.vertices.push_back(vertex);
    }
}

}  // namespace

std::vector<uint8_t> encodeGroup(const WeldedMesh& mesh, const std::vector<const Cluster*>& members,
                                 const std::vector<Producer>& producers, const MeshBuildSettings& settings,
                                 Group& group) {
    Chunk chunk;
    if (mesh.isWide()) countFromOrigin(mesh, members, group.node);
    std::vector<uint32_t> order;  // vertices of one cluster, by first use
    // Vertex -> its number in the cluster: open addressing, four places for each vertex that there can be.
    struct Slot {
        uint32_t vertex = ~0u, number = 0;
    };
    constexpr uint32_t kSlots = 1024;
    std::vector<Slot> slots(kSlots);
    const auto numberOf = [&](uint32_t v) {
        uint32_t at = v * 0x9e3779b1u >> 22;
        while (slots[at].vertex != v) {
            if (slots[at].vertex == ~0u) {
                slots[at] = {v, static_cast<uint32_t>(order.size())};
                order.push_back(v);
                break;
            }
            at = (at + 1) % kSlots;
        }
        return slots[at].number;
    };
    for (const Cluster* c : members) {
        order.clear();
        std::fill(slots.begin(), slots.end(), Slot{});
        shared::MeshCluster cluster{static_cast<uint32_t>(chunk.vertices.size()),
                                    static_cast<uint32_t>(chunk.triangles.size()), 0};
        for (size_t i = 0; i < c->indices.size(); i += 3) {
            const uint32_t a = numberOf(c->indices[i]), b = numberOf(c->indices[i + 1]);
            chunk.triangles.push_back(a | b << 8 | numberOf(c->indices[i + 2]) << 16);
        }
        const auto triangles = static_cast<uint32_t>(c->indices.size() / 3);
        appendVertices(mesh, order, group.node, chunk);
        cluster.counts = static_cast<uint32_t>(chunk.vertices.size() - cluster.firstVertex) | triangles << 16;
        const uint32_t producer = c->producer == kNoProducer ? MeshRun::kOriginal : producers[c->producer].number;
        if (group.runs.empty() || group.runs.back().producer != producer)
            group.runs.push_back({producer, static_cast<uint32_t>(chunk.clusters.size()), 0, 0});
        ++group.runs.back().clusters;
        group.runs.back().triangles += triangles;
        chunk.clusters.push_back(cluster);
    }
    describeTextures(settings, chunk, group);
    group.node.records = static_cast<uint32_t>(chunk.triangles.size());
    group.counts.vertices = static_cast<uint32_t>(chunk.vertices.size());
    group.counts.clusters = static_cast<uint32_t>(chunk.clusters.size());
    return encodeMeshChunk(chunk);
}

}  // namespace stipple::lod
