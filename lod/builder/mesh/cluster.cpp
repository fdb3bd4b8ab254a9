// Clusters by meshoptimizer, and groups of clusters that share long borders.
#include <meshoptimizer.h>

#include <algorithm>

#include "lod/builder/mesh/mesh_work.h"
#include "lod/builder/mesh/partition.h"

namespace stipple::lod {
namespace {

constexpr size_t kBlockTriangles = 32768;  ///< of the Morton order, clustered on their own

}  // namespace

namespace {

void placeLocal(const WeldedMesh& mesh, LocalMesh& local) {
    constexpr uint64_t kExact = 1u << 24;
    uint64_t any = 0;
    for (const uint32_t v : local.global) {
        const Steps p = mesh.at(v);
        any |= static_cast<uint64_t>(p.x | p.y | p.z);  // (of negative ones more than kExact)
    }
    std::vector<int64_t> along(local.global.size());
    for (int a = 0; a < 3 && any > kExact; ++a) {  // the median
        for (size_t i = 0; i < along.size(); ++i) along[i] = mesh.at(local.global[i])[a];
        const auto middle = along.begin() + static_cast<ptrdiff_t>(along.size() / 2);
        std::nth_element(along.begin(), middle, along.end());
        local.shift[a] = *middle;
    }
    for (const uint32_t v : local.global) local.position.emplace_back(mesh.at(v) - local.shift);
    local.isWide = mesh.isWide();
}

}  // namespace

LocalMesh makeLocal(const WeldedMesh& mesh, const std::vector<const Cluster*>& clusters) {
    // Global vertex -> local, valid where the stamp is this call's.
    thread_local std::vector<uint32_t> local, stamp;
    thread_local uint32_t epoch = 0;
    if (local.size() < mesh.vertices.size()) {
        local.assign(mesh.vertices.size(), 0);
        stamp.assign(mesh.vertices.size(), 0);
        epoch = 0;
    }
    ++epoch;
    LocalMesh out;
    size_t total = 0;
    for (const Cluster* c : clusters) total += c->indices.size();
    out.indices.reserve(total);
    for (const Cluster* c : clusters)
        for (const uint32_t v : c->indices) {
            if (stamp[v] != epoch) {
                stamp[v] = epoch;
                local[v] = static_cast<uint32_t>(out.global.size());
                out.global.push_back(v);
            }
            out.indices.push_back(local[v]);
        }
    placeLocal(mesh, out);
    return out;
}

void appendClusters(const LocalMesh& local, const std::vector<uint32_t>& given, Triangles triangles,
                    std::vector<Cluster>& out) {
    std::vector<uint32_t> alongCurve;
    if (triangles == Triangles::ofInput) {
        alongCurve.resize(given.size());
        meshopt_spatialSortTriangles(alongCurve.data(), given.data(), given.size(), &local.position[0].x,
                                     local.position.size(), sizeof(glm::vec3));
    }
    const std::vector<uint32_t>& indices = triangles == Triangles::ofInput ? alongCurve : given;
    // (Coordinates of 64 bits take two places.)
    const size_t mostVertices = local.isWide ? shared::kClusterVertices / 2 : shared::kClusterVertices;
    constexpr size_t kTriangles = shared::kClusterTriangles;
    const size_t bound = meshopt_buildMeshletsBound(indices.size(), mostVertices, kTriangles);
    std::vector<meshopt_Meshlet> meshlets(bound);
    std::vector<uint32_t> vertices(bound * mostVertices);
    std::vector<uint8_t> corners(bound * kTriangles * 3);
    const size_t count =
        triangles != Triangles::any
            ? meshopt_buildMeshletsScan(meshlets.data(), vertices.data(), corners.data(), indices.data(),
                                        indices.size(), local.position.size(), mostVertices, kTriangles)
            : meshopt_buildMeshlets(meshlets.data(), vertices.data(), corners.data(), indices.data(), indices.size(),
                                    &local.position[0].x, local.position.size(), sizeof(glm::vec3), mostVertices,
                                    kTriangles, 0.0f);
    meshlets.resize(count);
    for (const meshopt_Meshlet& m : meshlets) {
        Cluster c;
        c.indices.reserve(size_t{m.triangle_count} * 3);
        for (size_t k = 0; k < size_t{m.triangle_count} * 3; ++k)
            c.indices.push_back(local.global[vertices[m.vertex_offset + corners[m.triangle_offset + k]]]);
        out.push_back(std::move(c));
    }
}

std::vector<Cluster> makeClusters(const WeldedMesh& mesh, const std::vector<uint32_t>& indices, Executor& executor) {
    const size_t triangles = indices.size() / 3, blocks = (triangles + kBlockTriangles - 1) / kBlockTriangles;
    std::vector<std::vector<Cluster>> parts(blocks);
    executor.parallelFor(blocks, 1, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
            Cluster block;
            const auto first = static_cast<ptrdiff_t>(3 * b * kBlockTriangles),
                       last = static_cast<ptrdiff_t>(3 * std::min(triangles, (b + 1) * kBlockTriangles));
            block.indices.assign(indices.begin() + first, indices.begin() + last);
            const LocalMesh local = makeLocal(mesh, {&block});
            appendClusters(local, local.indices, Triangles::alongCurve, parts[b]);
        }
    });
    std::vector<Cluster> all;
    for (auto& part : parts) std::move(part.begin(), part.end(), std::back_inserter(all));
    return all;
}

namespace {

/// Edges on the border of a cluster, by position: they are what two clusters can share.
struct BorderEdge {
    uint64_t key;
    uint32_t cluster;
};

std::vector<BorderEdge> borderEdges(const WeldedMesh& mesh, const std::vector<Cluster>& clusters, Executor& executor) {
    std::vector<std::vector<BorderEdge>> borders(clusters.size());
    executor.parallelFor(clusters.size(), 64, [&](size_t begin, size_t end) {
        // How often the cluster has each edge: open addressing, more places than there can be edges.
        constexpr uint32_t kSlots = 1024;
        static_assert(kSlots > 3 * shared::kClusterTriangles);
        struct Slot {
            uint64_t key = ~uint64_t{0};
            uint32_t uses = 0;
        };
        std::vector<Slot> slots(kSlots);
        for (size_t c = begin; c < end; ++c) {
            std::fill(slots.begin(), slots.end(), Slot{});
            const auto& t = clusters[c].indices;
            for (size_t i = 0; i < t.size(); i += 3)
                for (size_t k = 0; k < 3; ++k) {
                    const uint64_t a = mesh.position[t[i + k]], b = mesh.position[t[i + (k + 1) % 3]];
                    const uint64_t key = std::min(a, b) << 32 | std::max(a, b);
                    uint64_t at = (key ^ key >> 32) * 0x9e3779b97f4a7c15ull >> 54;
                    while (slots[at].uses > 0 && slots[at].key != key) at = (at + 1) % kSlots;
                    slots[at].key = key;
                    ++slots[at].uses;
                }
            for (const Slot& s : slots)
                if (s.uses == 1) borders[c].push_back({s.key, static_cast<uint32_t>(c)});
        }
    });
    std::vector<BorderEdge> edges;
    for (const auto& b : borders) edges.insert(edges.end(), b.begin(), b.end());
    std::sort(edges.begin(), edges.end(), [](const BorderEdge& a, const BorderEdge& b) {
        return a.key != b.key ? a.key < b.key : a.cluster < b.cluster;
    });
    return edges;
}

/// Pairs of clusters, both directions, from << 32 | to, once for every edge that they share.
std::vector<uint64_t> sharedEdges(const std::vector<BorderEdge>& edges) {
    std::vector<uint64_t> links;
    for (size_t i = 0; i < edges.size();) {
        size_t j = i;
        while (j < edges.size() && edges[j].key == edges[i].key) ++j;
        for (size_t a = i; a < j; ++a)
            for (size_t b = i; b < j && j - i <= 8; ++b)
                if (a != b) links.push_back(uint64_t{edges[a].cluster} << 32 | edges[b].cluster);
        i = j;
    }
    return links;
}

ClusterGraph graphOf(std::vector<uint64_t> links, uint32_t count) {
    ClusterGraph graph;
    // Clusters that touch nothing belong to those beside them on the curve.
    constexpr int32_t kShared = 16;
    for (uint32_t c = 0; c + 1 < count; ++c) {
        links.push_back(uint64_t{c} << 32 | (c + 1));
        links.push_back(uint64_t{c + 1} << 32 | c);
    }
    std::sort(links.begin(), links.end());
    for (size_t i = 0; i < links.size();) {
        size_t j = i;
        while (j < links.size() && links[j] == links[i]) ++j;
        const auto a = static_cast<uint32_t>(links[i] >> 32), b = static_cast<uint32_t>(links[i]);
        while (graph.count() < a) graph.start.push_back(static_cast<uint32_t>(graph.neighbour.size()));
        graph.neighbour.push_back(b);
        const bool isBeside = a + 1 == b || b + 1 == a;
        graph.weight.push_back(kShared * static_cast<int32_t>(j - i - (isBeside ? 1 : 0)) + 1);
        i = j;
    }
    while (graph.count() < count) graph.start.push_back(static_cast<uint32_t>(graph.neighbour.size()));
    return graph;
}

}  // namespace

std::vector<std::vector<uint32_t>> groupClusters(const WeldedMesh& mesh, const std::vector<Cluster>& clusters,
                                                 uint32_t size, Executor& executor) {
    const auto count = static_cast<uint32_t>(clusters.size());
    std::vector<std::vector<uint32_t>> groups;
    if (count <= size) {
        groups.emplace_back();
        for (uint32_t i = 0; i < count; ++i) groups[0].push_back(i);
        return groups;
    }
    const std::vector<uint32_t> part =
        partition(graphOf(sharedEdges(borderEdges(mesh, clusters, executor)), count), size);
    groups.resize((count + size - 1) / size);
    for (uint32_t c = 0; c < count; ++c) groups[part[c]].push_back(c);
    std::sort(groups.begin(), groups.end());
    return groups;
}

namespace {

bool isLong(const WeldedMesh& mesh, const uint32_t* corners) {
    const Steps a = mesh.at(corners[0]), b = mesh.at(corners[1]), c = mesh.at(corners[2]);
    const Steps size = glm::max(a, glm::max(b, c)) - glm::min(a, glm::min(b, c));
    return std::max({size.x, size.y, size.z}) > int64_t{1} << kShortMeshBits;
}

}  // namespace

size_t longOnesLast(const WeldedMesh& mesh, std::vector<uint32_t>& indices) {
    if (!mesh.isWide()) return indices.size();
    std::vector<uint32_t> others, longOnes;
    for (size_t i = 0; i < indices.size(); i += 3) {
        auto& to = isLong(mesh, &indices[i]) ? longOnes : others;
        to.insert(to.end(), indices.begin() + static_cast<ptrdiff_t>(i),
                  indices.begin() + static_cast<ptrdiff_t>(i + 3));
    }
    indices = others;
    indices.insert(indices.end(), longOnes.begin(), longOnes.end());
    return others.size();
}

std::vector<std::vector<uint32_t>> groupApart(const WeldedMesh& mesh, const std::vector<Cluster>& clusters,
                                              uint32_t size, Executor& executor) {
    if (!mesh.isWide()) return groupClusters(mesh, clusters, size, executor);
    std::array<std::vector<uint32_t>, 2> numbers;  // without long ones, with
    std::array<std::vector<Cluster>, 2> apart;
    for (uint32_t c = 0; c < clusters.size(); ++c) {
        const std::vector<uint32_t>& corners = clusters[c].indices;
        bool hasLong = false;
        for (size_t i = 0; i < corners.size() && !hasLong; i += 3) hasLong = isLong(mesh, &corners[i]);
        numbers.at(hasLong ? 1 : 0).push_back(c);
        apart.at(hasLong ? 1 : 0).push_back(clusters[c]);
    }
    std::vector<std::vector<uint32_t>> groups;
    for (size_t k = 0; k < 2; ++k) {
        if (apart.at(k).empty()) continue;
        for (auto& group : groupClusters(mesh, apart.at(k), size, executor)) {
            for (uint32_t& c : group) c = numbers.at(k)[c];
            groups.push_back(std::move(group));
        }
    }
    return groups;
}

}  // namespace stipple::lod
