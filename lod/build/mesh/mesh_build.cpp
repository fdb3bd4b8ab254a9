// A mesh build as a straight line.
#include "lod/build/mesh/mesh_build.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/build/mesh/mesh_work.h"

namespace stipple::lod {
namespace {

constexpr double kWorthwhile = 0.85;     ///< a simplification that keeps more triangles than this is not used
constexpr double kUnimportant = 0.25;    ///< share of the error below that one level may add unseen
constexpr size_t kFewestTriangles = 16;  ///< below that nothing is simplified any more
constexpr uint64_t kManyRoots = 20'000;  ///< triangles of the coarsest level that are worth a note
constexpr float kAnyError = 1e9f;        ///< the target is a number of triangles

struct Sphere {
    glm::dvec3 centre{0};
    double radius = 0;
};

/// A group in the order of the build: fine before coarse.
struct Group {
    Node node;
    MeshGroup counts;
    std::vector<MeshRun> runs;  ///< producers are numbers of the build's order
    std::vector<uint32_t> textures;
    double error = 0;  ///< lattice units
};

Sphere sphereOf(const LocalMesh& local, const std::vector<Sphere>& inside) {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const glm::vec3& p : local.position) {
        lo = glm::min(lo, glm::dvec3(p));
        hi = glm::max(hi, glm::dvec3(p));
    }
    for (const Sphere& s : inside) {
        lo = glm::min(lo, s.centre - s.radius);
        hi = glm::max(hi, s.centre + s.radius);
    }
    Sphere out{0.5 * (lo + hi), 0};
    for (const glm::vec3& p : local.position)
        out.radius = std::max(out.radius, glm::length(glm::dvec3(p) - out.centre));
    for (const Sphere& s : inside) out.radius = std::max(out.radius, glm::length(s.centre - out.centre) + s.radius);
    out.radius *= 1 + 1e-12;
    return out;
}

class MeshBuilder {
  public:
    MeshBuilder(const WeldedMesh& mesh, const MeshBuildSettings& settings, StoreWriter& writer, Executor& executor,
                Progress& progress)
        : mesh_(mesh), settings_(settings), writer_(writer), executor_(executor), progress_(progress) {}

    Result<void> run() {
        std::vector<Cluster> clusters = makeClusters(mesh_, executor_);
        const uint64_t expected = 2 * uint64_t{mesh_.indices.size()} / 3;
        uint64_t before = ~uint64_t{0};
        for (;;) {
            uint64_t triangles = 0;
            for (const Cluster& c : clusters) triangles += c.indices.size() / 3;
            if (triangles <= kFewestTriangles || static_cast<double>(triangles) > 0.97 * static_cast<double>(before))
                break;
            before = triangles;
            STIPPLE_ASSIGN(clusters, nextLevel(std::move(clusters), expected));
        }
        return writeRoots(clusters);
    }

    /// The tables in the order of the file: coarse before fine.
    void tables(Hierarchy& h) const {
        const auto count = static_cast<uint32_t>(groups_.size());
        h.origin = mesh_.origin;
        h.unit = mesh_.unit;
        h.rootLog2 = 24;
        double smallest = 1e300;
        for (const Group& g : groups_)
            if (g.error > 0 && g.error < kRootError) smallest = std::min(smallest, g.error);
        h.errors.smallest = smallest < 1e300 ? smallest * 0.9 : 1;
        std::vector<std::vector<uint32_t>> parents(count);
        h.nodes.resize(count);
        h.groups.resize(count);
        for (uint32_t i = 0; i < count; ++i) {
            const Group& g = groups_[count - 1 - i];
            h.nodes[i] = g.node;
            h.groups[i] = g.counts;
            h.nodes[i].errorCode =
                static_cast<uint8_t>(g.error >= kRootError ? ErrorScale::kNoParent : h.errors.encodeUp(g.error));
            h.groups[i].firstRun = static_cast<uint32_t>(h.runs.size());
            h.groups[i].runs = static_cast<uint32_t>(g.runs.size());
            h.groups[i].firstTexture = static_cast<uint32_t>(h.groupTextures.size());
            h.groups[i].textures = static_cast<uint32_t>(g.textures.size());
            h.groupTextures.insert(h.groupTextures.end(), g.textures.begin(), g.textures.end());
            for (MeshRun run : g.runs) {
                if (run.producer != MeshRun::kOriginal) {
                    run.producer = count - 1 - run.producer;
                    parents[run.producer].push_back(i);
                }
                h.runs.push_back(run);
            }
        }
        for (uint32_t i = 0; i < count; ++i) {
            h.groups[i].firstParent = static_cast<uint32_t>(h.parents.size());
            h.groups[i].parents = static_cast<uint32_t>(parents[i].size());
            uint32_t level = 0;
            for (const uint32_t p : parents[i]) level = std::max(level, h.nodes[p].level + 1u);
            h.nodes[i].level = static_cast<uint8_t>(std::min(level, 255u));
            h.nodes[i].parent = parents[i].empty() ? 0 : parents[i][0];
            h.parents.insert(h.parents.end(), parents[i].begin(), parents[i].end());
        }
    }

  private:
    static constexpr double kRootError = 1e300;

    struct Made {
        Group group;
        std::vector<uint8_t> bytes;
        std::vector<Cluster> products;
        bool isSimplified = false;
    };

    Result<std::vector<Cluster>> nextLevel(std::vector<Cluster> clusters, uint64_t expected) {
        const auto members = groupClusters(mesh_, clusters, settings_.groupClusters, executor_);
        std::vector<Cluster> next;
        constexpr size_t kBatch = 64;  // bounds what waits to be written
        for (size_t first = 0; first < members.size(); first += kBatch) {
            const size_t count = std::min(kBatch, members.size() - first);
            std::vector<Made> made(count);
            executor_.parallelFor(count, 1, [&](size_t begin, size_t end) {
                for (size_t i = begin; i < end; ++i) {
                    std::vector<const Cluster*> of;
                    for (const uint32_t c : members[first + i]) of.push_back(&clusters[c]);
                    made[i] = simplify(of, false);
                }
            });
            for (size_t i = 0; i < count; ++i) {
                if (!made[i].isSimplified) {  // with other neighbours it may shrink
                    for (const uint32_t c : members[first + i]) next.push_back(std::move(clusters[c]));
                    continue;
                }
                const auto number = static_cast<uint32_t>(groups_.size());
                written_ += made[i].group.node.records;
                for (Cluster& c : made[i].products) {
                    c.producer = number;
                    next.push_back(std::move(c));
                }
                STIPPLE_TRY(append(std::move(made[i])));
                for (const uint32_t c : members[first + i]) clusters[c].indices = {};
            }
            progress_.update("simplify", std::min(written_, expected), expected);
        }
        return next;
    }

    Result<void> writeRoots(const std::vector<Cluster>& clusters) {
        auto members = groupClusters(mesh_, clusters, settings_.groupClusters, executor_);
        for (const auto& group : members) {
            std::vector<const Cluster*> of;
            of.reserve(group.size());
            for (const uint32_t c : group) of.push_back(&clusters[c]);
            Made made = simplify(of, true);
            STIPPLE_TRY(append(std::move(made)));
        }
        return {};
    }

    Result<void> append(Made made) {
        STIPPLE_TRY(writer_.appendChunk(made.bytes, {}, made.group.node));
        groups_.push_back(std::move(made.group));
        return {};
    }

    /// One group: what it is simplified to and how far that is from the input, and its own chunk.
    Made simplify(std::vector<const Cluster*> members, bool isRoot) const {
        Made made;
        std::stable_sort(members.begin(), members.end(),
                         [](const Cluster* a, const Cluster* b) { return a->producer < b->producer; });
        const LocalMesh local = makeLocal(mesh_, members);
        // Monotone, and a bound against the input: what is already wrong plus what is added.
        double below = 0;
        std::vector<Sphere> inside;
        for (size_t i = 0; i < members.size(); ++i) {
            const uint32_t p = members[i]->producer;
            if (p == kNoProducer || (i > 0 && p == members[i - 1]->producer)) continue;
            below = std::max(below, groups_[p].error);
            inside.push_back({groups_[p].node.centre, groups_[p].node.radius});
        }
        if (!isRoot) {
            const size_t target = local.indices.size() / 6 * 3;
            std::vector<uint32_t> coarse(local.indices.size());
            coarse.resize(meshopt_simplify(coarse.data(), local.indices.data(), local.indices.size(),
                                           &local.position[0].x, local.position.size(), sizeof(glm::vec3), target,
                                           kAnyError, meshopt_SimplifyLockBorder, nullptr));
            if (coarse.empty() ||
                static_cast<double>(coarse.size()) > kWorthwhile * static_cast<double>(local.indices.size()))
                return made;
            made.group.error = measureDeviation(mesh_, local, coarse, kUnimportant * below);
            STIPPLE_CHECK(made.group.error >= 0 && made.group.error < kRootError, "deviation of a group");
            appendClusters(local, coarse, kNoProducer, false, made.products);
        }
        made.isSimplified = true;
        made.group.error = isRoot ? kRootError : made.group.error + below;
        const Sphere sphere = sphereOf(local, inside);
        made.group.node.centre = sphere.centre;
        made.group.node.radius = sphere.radius;
        made.bytes = encode(members, made.group);
        return made;
    }

    /// Which textures the group shows, what part of them, and how densely.
    void describeTextures(const Chunk& chunk, Group& group) const {
        constexpr float kAll = 1e6f;
        std::vector<uint8_t> isUsed(settings_.textures.size());
        glm::vec2 lo(kAll), hi(-kAll);
        const auto& materials = settings_.description.materials;
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
                const auto &a = vertex(0), &b = vertex(1), &d = vertex(2);
                if ((a.surface & shared::kSurfaceTextured) == 0) continue;
                inSpace += glm::length(glm::cross(glm::dvec3(b.x - a.x, b.y - a.y, b.z - a.z),
                                                  glm::dvec3(d.x - a.x, d.y - a.y, d.z - a.z)));
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

    std::vector<uint8_t> encode(const std::vector<const Cluster*>& members, Group& group) const {
        Chunk chunk;
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
            cluster.counts = static_cast<uint32_t>(order.size()) | triangles << 16;
            for (const uint32_t v : order) chunk.vertices.push_back(mesh_.vertices[v]);
            const uint32_t producer = c->producer == kNoProducer ? MeshRun::kOriginal : c->producer;
            if (group.runs.empty() || group.runs.back().producer != producer)
                group.runs.push_back({producer, static_cast<uint32_t>(chunk.clusters.size()), 0, 0});
            ++group.runs.back().clusters;
            group.runs.back().triangles += triangles;
            chunk.clusters.push_back(cluster);
        }
        describeTextures(chunk, group);
        group.node.records = static_cast<uint32_t>(chunk.triangles.size());
        group.counts.vertices = static_cast<uint32_t>(chunk.vertices.size());
        group.counts.clusters = static_cast<uint32_t>(chunk.clusters.size());
        return encodeMeshChunk(chunk);
    }

    const WeldedMesh& mesh_;
    const MeshBuildSettings& settings_;
    StoreWriter& writer_;
    Executor& executor_;
    Progress& progress_;
    std::vector<Group> groups_;
    uint64_t written_ = 0;
};

}  // namespace

Result<BuildReport> buildMeshStore(TriangleMesh input, const std::string& output, const MeshBuildSettings& settings,
                                   Executor& executor, Progress& progress) {
    BuildReport report;
    StageClock clock(report);
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(output));
    report.primitive = "triangle";
    report.pointsIn = input.indices.size() / 3;
    const WeldedMesh mesh = weldMesh(std::move(input), executor);
    clock.ends("weld");
    for (const auto& [reason, count] :
         {std::pair{"degenerate triangles", mesh.degenerate}, std::pair{"duplicate triangles", mesh.duplicate},
          std::pair{"triangles that are not finite", mesh.notFinite}})
        if (count > 0) report.dropped[reason] = count;
    if (mesh.indices.empty())
        return fail(ErrorKind::input, "holds no triangle with an area", settings.description.source);
    MeshBuilder builder(mesh, settings, writer, executor, progress);
    STIPPLE_TRY(builder.run());
    clock.ends("simplify");
    Hierarchy hierarchy;
    builder.tables(hierarchy);
    STIPPLE_TRY(writeTextures(settings.textures, writer, hierarchy, executor));
    clock.ends("textures");
    StoreDescription description = settings.description;
    description.points = report.pointsOut = mesh.indices.size() / 3;
    for (const Node& node : hierarchy.nodes) description.records += node.records;
    description.roundingUnits = mesh.rounding;
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const shared::MeshVertex& v : mesh.vertices) {
        lo = glm::min(lo, glm::dvec3(v.x, v.y, v.z));
        hi = glm::max(hi, glm::dvec3(v.x, v.y, v.z));
    }
    description.boundsMin = description.focusMin = mesh.origin + mesh.unit * lo;
    description.boundsMax = description.focusMax = mesh.origin + mesh.unit * hi;
    description.hasColour = description.hasNormals = description.isReflectance = true;
    STIPPLE_TRY(writer.finish(hierarchy, description));
    clock.ends("finish");
    STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
    STIPPLE_TRY(verifyStore(store, executor));
    clock.ends("verify");
    report.bytesOut = writer.bytes();
    STIPPLE_TRY(writer.commit());
    report.nodes = hierarchy.nodes.size();
    report.records = description.records;
    report.contentHash = writer.contentHash();
    uint64_t coarsest = 0;
    for (size_t i = 0; i < hierarchy.nodes.size(); ++i)
        coarsest += hierarchy.groups[i].parents == 0 ? hierarchy.nodes[i].records : 0;
    if (coarsest > kManyRoots)
        report.notes.push_back(
            fmt::format("{} triangles cannot be simplified (many small separate parts): they are "
                        "drawn whatever the distance",
                        coarsest));
    report.seconds = clock.seconds();
    return report;
}

}  // namespace stipple::lod
