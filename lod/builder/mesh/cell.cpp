#include "lod/builder/mesh/cell.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "lod/builder/mesh/encode.h"
#include "lod/builder/mesh/parts.h"

namespace stipple::lod {
namespace {

constexpr double kWorthwhile = 0.85;      ///< a simplification that keeps more triangles than this is not used
constexpr double kUnimportant = 0.25;     ///< share of the error below that one level may add unseen
constexpr double kStalled = 0.97;         ///< a level that keeps more than this of all triangles is the last one
constexpr size_t kFewestTriangles = 16;   ///< below that nothing is simplified any more
constexpr size_t kGoingUp = 16384;        ///< triangles of a cell that its parent goes on with
constexpr size_t kMostGoingUp = 32768;    ///< of what cannot be simplified
constexpr float kAnyError = 1e9f;         ///< the target is a number of triangles
constexpr uint32_t kMoved = 0x80000000u;  ///< in the number of a vertex: of those that a group moved

struct Sphere {
    glm::dvec3 centre{0};
    double radius = 0;
};

Sphere sphereOf(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<Sphere>& inside) {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const uint32_t v : local.global) {
        lo = glm::min(lo, glm::dvec3(mesh.at(v)));
        hi = glm::max(hi, glm::dvec3(mesh.at(v)));
    }
    for (const Sphere& s : inside) {
        lo = glm::min(lo, s.centre - s.radius);
        hi = glm::max(hi, s.centre + s.radius);
    }
    Sphere out{0.5 * (lo + hi), 0};
    for (const uint32_t v : local.global)
        out.radius = std::max(out.radius, glm::length(glm::dvec3(mesh.at(v)) - out.centre));
    for (const Sphere& s : inside) out.radius = std::max(out.radius, glm::length(s.centre - out.centre) + s.radius);
    out.radius *= 1 + 1e-12;
    return out;
}

class CellReducer {
  public:
    CellReducer(const Frame& frame, const Lattice& lattice, const MeshBuildSettings& settings, Executor& executor)
        : frame_(frame), lattice_(lattice), settings_(settings), executor_(executor) {}

    Result<void> takeInput(const std::vector<uint8_t>& bytes) {
        Soup soup;
        ByteReader from(bytes);
        while (!from.isWhole())
            if (!getSoup(from, soup)) return damaged();
        mesh_ = weld(soup);
        soup.vertices = {};
        table_.duplicate = sortTriangles(mesh_, soup.indices);
        table_.triangles = soup.indices.size() / 3;
        for (uint32_t v = 0; v < mesh_.vertices.size(); ++v) {
            table_.lo = v == 0 ? mesh_.at(v) : glm::min(table_.lo, mesh_.at(v));
            table_.hi = v == 0 ? mesh_.at(v) : glm::max(table_.hi, mesh_.at(v));
        }
        makeFirstClusters(soup.indices);
        return {};
    }

    Result<void> takeBelow(const std::vector<FromBelow>& below) {
        Soup soup;
        for (const FromBelow& child : below) {
            ByteReader from(child.bytes);
            std::vector<Producer> producers;
            std::vector<ClusterHead> heads;
            from.get(producers);
            from.get(heads);
            const auto firstProducer = static_cast<uint32_t>(producers_.size());
            for (Producer& p : producers) {
                if ((p.number & Group::kOwn) != 0)
                    p.number = static_cast<uint32_t>(child.label) + (p.number & ~Group::kOwn);
                producers_.push_back(p);
            }
            size_t at = soup.indices.size();
            if (!getSoup(from, soup) || !from.isWhole()) return damaged();
            for (const ClusterHead& head : heads) {
                Cluster c;
                if (head.indices > soup.indices.size() - at) return damaged();
                const auto first = soup.indices.begin() + static_cast<ptrdiff_t>(at);
                c.indices.assign(first, first + head.indices);
                if (head.producer != kNoProducer) c.producer = firstProducer + head.producer;
                c.isWhole = head.isWhole != 0;
                c.isContinued = head.isContinued != 0;
                at += head.indices;
                clusters_.push_back(std::move(c));
            }
        }
        mesh_ = weld(soup);
        size_t at = 0;
        for (Cluster& c : clusters_)
            for (uint32_t& i : c.indices) i = soup.indices[at++];
        return {};
    }

    CellProduct run(const WorkCell& cell) {
        const bool isLast = cell.isLast;
        uint64_t before = ~uint64_t{0}, triangles = trianglesNow();
        bool isStalled = false;
        while (triangles > (isLast ? kFewestTriangles : kGoingUp) && !isStalled) {
            before = triangles;
            clusters_ = nextLevel(std::move(clusters_));
            triangles = trianglesNow();
            isStalled = static_cast<double>(triangles) > kStalled * static_cast<double>(before);
        }
        if (isLast || triangles > kMostGoingUp) {
            writeRoots();
            clusters_ = {};
        }
        CellProduct out;
        out.chunks = std::move(chunks_);
        ByteWriter table;
        table_.put(table);
        out.table = table.bytes();
        if (!isLast) out.up = goingUp(cell.level - 1);
        return out;
    }

  private:
    struct ClusterHead {
        uint32_t indices, producer, isWhole, isContinued;
    };
    struct Made {
        Group group;
        std::vector<uint8_t> bytes;
        std::vector<Cluster> products;
        std::vector<shared::MeshVertex> moved;  ///< numbered from the mesh's last on
        std::vector<uint32_t> movedPosition;
        bool isSimplified = false;
    };

    static tl::unexpected<Error> damaged() {
        return fail(ErrorKind::input, "a temporary file is not what was written", "", "build again");
    }

    uint64_t trianglesNow() const {
        uint64_t sum = 0;
        for (const Cluster& c : clusters_) sum += c.indices.size() / 3;
        return sum;
    }

    /// Cells one level up are shifted by a third of their edge, so that a border between two cells, along which
    /// nothing can be simplified, lies inside a cell of the next level. (Those of the plain octree would keep every
    /// edge along a cell's border until the cell that holds both sides.)
    Key keyAbove(const Cluster& c, int level) const {
        if (level < 0) return 0;
        Steps lo = mesh_.at(c.indices[0]), hi = lo;
        for (const uint32_t i : c.indices) {
            lo = glm::min(lo, mesh_.at(i));
            hi = glm::max(hi, mesh_.at(i));
        }
        const glm::u64vec3 middle = keyPlace((lo + hi) / int64_t{2}, lattice_);
        const auto edge = static_cast<uint64_t>(frame_.cellSize(static_cast<uint32_t>(level)));
        const auto along = [&](uint64_t at) { return (3 * at + 2 * edge) / (3 * edge); };
        return mortonCode(along(middle.x), along(middle.y), along(middle.z));
    }

    std::vector<GoingUp> goingUp(int level) const {
        std::map<Key, std::vector<const Cluster*>> byCell;
        Key above = 0;
        for (const Cluster& c : clusters_) {
            if (!c.isContinued) above = keyAbove(c, level);
            byCell[above].push_back(&c);
        }
        std::vector<GoingUp> out;
        out.reserve(byCell.size());
        for (const auto& [key, clusters] : byCell) out.push_back({key, bytesOf(clusters)});
        return out;
    }

    std::vector<uint8_t> bytesOf(const std::vector<const Cluster*>& clusters) const {
        std::vector<uint32_t> place(mesh_.vertices.size(), ~0u), number(producers_.size(), ~0u);
        std::vector<Producer> producers;
        std::vector<ClusterHead> heads;
        Soup soup;
        for (const Cluster* c : clusters) {
            ClusterHead head{static_cast<uint32_t>(c->indices.size()), kNoProducer, c->isWhole ? 1u : 0u,
                             c->isContinued ? 1u : 0u};
            if (c->producer != kNoProducer) {
                uint32_t& n = number[c->producer];
                if (n == ~0u) {
                    n = static_cast<uint32_t>(producers.size());
                    producers.push_back(producers_[c->producer]);
                }
                head.producer = n;
            }
            heads.push_back(head);
            for (const uint32_t v : c->indices) {
                if (place[v] == ~0u) {
                    place[v] = static_cast<uint32_t>(soup.vertices.size());
                    soup.vertices.add(mesh_.vertices, v);
                }
                soup.indices.push_back(place[v]);
            }
        }
        ByteWriter to;
        to.put(producers);
        to.put(heads);
        putSoup(soup, to);
        return to.bytes();
    }

    std::vector<Cluster> nextLevel(std::vector<Cluster> clusters) {
        const auto members = groupsOf(clusters);
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
                const auto number = static_cast<uint32_t>(producers_.size());
                const auto firstMoved = static_cast<uint32_t>(mesh_.vertices.size());
                for (const shared::MeshVertex& v : made[i].moved) mesh_.vertices.addShort(v, lattice_.isWide());
                mesh_.position.insert(mesh_.position.end(), made[i].movedPosition.begin(), made[i].movedPosition.end());
                for (Cluster& c : made[i].products) {
                    for (uint32_t& v : c.indices)
                        if ((v & kMoved) != 0) v = firstMoved + (v & ~kMoved);
                    c.producer = number;
                    next.push_back(std::move(c));
                }
                append(std::move(made[i]));
                for (const uint32_t c : members[first + i]) clusters[c].indices = {};
            }
        }
        return next;
    }

    void writeRoots() {
        for (const auto& group : groupsOf(clusters_)) {
            std::vector<const Cluster*> of;
            of.reserve(group.size());
            for (const uint32_t c : group) of.push_back(&clusters_[c]);
            append(simplify(of, true));
        }
    }

    void append(Made made) {
        Group& g = made.group;
        producers_.push_back(
            {static_cast<uint32_t>(table_.groups.size()) | Group::kOwn, g.error, g.node.centre, g.node.radius});
        g.node.chunkOffset = chunks_.size();
        g.node.chunkBytes = static_cast<uint32_t>(made.bytes.size());
        g.node.chunkHash = hashBytes(made.bytes.data(), made.bytes.size());
        g.node.attributeHash = hashBytes(nullptr, 0);
        chunks_.insert(chunks_.end(), made.bytes.begin(), made.bytes.end());
        table_.groups.push_back(std::move(g));
    }

    /// The least and the largest coordinate of what belongs to a part.
    int least() const { return lattice_.isWide() ? -static_cast<int>(kPartReach) : 0; }
    int largest() const { return static_cast<int>(lattice_.isWide() ? kPartReach : int64_t{1} << frame_.rootLog2) - 1; }

    std::vector<std::vector<uint32_t>> groupsOf(std::vector<Cluster>& clusters) {
        return groupAll(mesh_, clusters, settings_.groupClusters, executor_);
    }

    /// What was marked on the way (PartFinder) in clusters of its own.
    void makeFirstClusters(const std::vector<uint32_t>& indices) {
        std::vector<uint32_t> others;
        Cluster whole;
        for (size_t i = 0; i < indices.size(); i += 3) {
            const bool isOfPart = (mesh_.vertex(indices[i]).surface & kSurfaceOfPart) != 0;
            auto& to = isOfPart ? whole.indices : others;
            to.insert(to.end(), indices.begin() + static_cast<ptrdiff_t>(i),
                      indices.begin() + static_cast<ptrdiff_t>(i + 3));
        }
        for (shared::MeshVertex& v : mesh_.vertices.low) v.surface &= ~kSurfaceOfPart;
        const auto firstLong = others.begin() + static_cast<ptrdiff_t>(longOnesLast(mesh_, others));
        clusters_ = makeClusters(mesh_, {others.begin(), firstLong}, executor_);
        if (firstLong != others.end())
            for (Cluster& c : makeClusters(mesh_, {firstLong, others.end()}, executor_))
                clusters_.push_back(std::move(c));
        if (whole.indices.empty()) return;
        const LocalMesh local = makeLocal(mesh_, {&whole});
        appendParts(local, local.indices, clusters_);
    }

    void appendParts(const LocalMesh& local, const std::vector<uint32_t>& indices, std::vector<Cluster>& to) const {
        std::vector<uint32_t> ofTriangle;
        std::vector<std::vector<uint32_t>> parts(partsOf(mesh_, local, indices, ofTriangle));
        for (size_t i = 0; i < indices.size(); ++i) parts[ofTriangle[i / 3]].push_back(indices[i]);
        appendWholeClusters(local, parts, to);
    }

    /// Vertices at new places, numbered as kMoved + n until they have their places in the mesh.
    void takeMoved(LocalMesh& local, Made& made) const {
        for (uint32_t v = local.firstMoved(); v < local.position.size(); ++v) {
            const uint32_t from = local.global[v];
            const glm::ivec3 at = local.movedTo[v - local.firstMoved()];
            shared::MeshVertex vertex = mesh_.vertex(from);
            vertex.x = at.x;
            vertex.y = at.y;
            vertex.z = at.z;
            local.global[v] = kMoved | static_cast<uint32_t>(made.moved.size());
            made.moved.push_back(vertex);
            made.movedPosition.push_back(mesh_.position[from]);
        }
    }

    static std::vector<uint32_t> simplifySurface(const LocalMesh& local) {
        const size_t target = local.indices.size() / 6 * 3;
        std::vector<uint32_t> coarse(local.indices.size());
        coarse.resize(meshopt_simplify(coarse.data(), local.indices.data(), local.indices.size(), &local.position[0].x,
                                       local.position.size(), sizeof(glm::vec3), target, kAnyError,
                                       meshopt_SimplifyLockBorder, nullptr));
        return coarse;
    }

    /// One group: what it is simplified to and how far that is from the input, and its own chunk.
    Made simplify(std::vector<const Cluster*> members, bool isRoot) const {
        Made made;
        std::stable_sort(members.begin(), members.end(),
                         [](const Cluster* a, const Cluster* b) { return a->producer < b->producer; });
        LocalMesh local = makeLocal(mesh_, members);
        // Monotone, and a bound against the input: what is already wrong plus what is added.
        double below = 0;
        std::vector<Sphere> inside;
        for (size_t i = 0; i < members.size(); ++i) {
            const uint32_t p = members[i]->producer;
            if (p == kNoProducer || (i > 0 && p == members[i - 1]->producer)) continue;
            below = std::max(below, producers_[p].error);
            inside.push_back({producers_[p].centre, producers_[p].radius});
        }
        const Sphere sphere = sphereOf(mesh_, local, inside);
        if (!isRoot) {
            const bool areParts = members.front()->isWhole;
            const std::vector<uint32_t> coarse =
                areParts ? simplifyParts(mesh_, local, local.indices.size() / 6 * 3, least(), largest())
                         : simplifySurface(local);
            if (coarse.empty() ||
                static_cast<double>(coarse.size()) > kWorthwhile * static_cast<double>(local.indices.size()))
                return made;
            made.group.error = measureDeviation(mesh_, local, coarse, kUnimportant * below, !areParts);
            STIPPLE_CHECK(made.group.error >= 0 && made.group.error < Group::kRootError, "deviation of a group");
            if (areParts) {
                takeMoved(local, made);
                appendParts(local, coarse, made.products);
            } else {
                appendClusters(local, coarse, inside.empty() ? Triangles::ofInput : Triangles::any, made.products);
            }
        }
        made.isSimplified = true;
        made.group.error = isRoot ? Group::kRootError : made.group.error + below;
        made.group.node.centre = sphere.centre;
        made.group.node.radius = sphere.radius;
        made.bytes = encodeGroup(mesh_, members, producers_, settings_, made.group);
        return made;
    }

    const Frame& frame_;
    const Lattice& lattice_;
    const MeshBuildSettings& settings_;
    Executor& executor_;
    WeldedMesh mesh_;
    std::vector<Cluster> clusters_;
    std::vector<Producer> producers_;  ///< those that came up and those of the cell
    std::vector<uint8_t> chunks_;
    CellTable table_;
};

}  // namespace

Result<CellProduct> reduceMeshCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame, const Lattice& lattice,
                                   const MeshBuildSettings& settings, Executor& executor) {
    CellReducer reducer(frame, lattice, settings, executor);
    if (cell.subtree != WorkCell::kNone) {
        STIPPLE_TRY(reducer.takeInput(input));
    } else {
        STIPPLE_TRY(reducer.takeBelow(below));
    }
    return reducer.run(cell);
}

void CellTable::put(ByteWriter& to) const {
    to.put(triangles);
    to.put(duplicate);
    to.put(lo);
    to.put(hi);
    to.put(uint64_t{groups.size()});
    for (const Group& g : groups) {
        to.put(g.node);
        to.put(g.counts);
        to.put(g.runs);
        to.put(g.textures);
        to.put(g.error);
    }
}

bool CellTable::get(ByteReader& from) {
    uint64_t count = 0;
    from.get(triangles);
    from.get(duplicate);
    from.get(lo);
    from.get(hi);
    from.get(count);
    for (uint64_t i = 0; i < count && !from.isWhole(); ++i) {
        Group g;
        from.get(g.node);
        from.get(g.counts);
        from.get(g.runs);
        from.get(g.textures);
        from.get(g.error);
        groups.push_back(std::move(g));
    }
    return from.isWhole() && groups.size() == count;
}

}  // namespace stipple::lod
