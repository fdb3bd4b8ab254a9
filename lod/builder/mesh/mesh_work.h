// What the stages of a mesh build hand to each other.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <vector>

#include "engine/base/executor.h"
#include "lod/builder/octree/bytes.h"
#include "lod/builder/octree/cells.h"
#include "lod/builder/points/outliers.h"
#include "lod/primitives/mesh_source.h"
#include "lod/store/mesh_place.h"
#include "lod/store/store.h"

namespace stipple::lod {

/// Lattice coordinates of a vertex.
using Steps = glm::i64vec3;

/// World = origin + unit * (x, y, z).
struct Lattice {
    glm::dvec3 origin{0};
    double unit = 1;
    /// 24: then fp32 holds coordinates exactly; more where a few vertices lie far out. Beyond kShortMeshBits
    /// coordinates lie around zero, which is where most vertices are: there doubles are finest, too.
    uint32_t bits = 24;
    Steps firstKey{0};                     ///< see keyPlace
    uint64_t largestKey = 0;               ///< of all axes
    glm::dvec3 focusLow{0}, focusHigh{0};  ///< what most vertices span, world units; of a wide lattice
    /// Beside what lies farther out the others' places could not be told apart; world units.
    glm::dvec3 reachLow{-kFarthestPlace}, reachHigh{kFarthestPlace};
    bool isWide() const { return bits > kShortMeshBits; }
    bool reaches(const glm::dvec3& p) const {
        return glm::all(glm::lessThanEqual(reachLow, p)) && glm::all(glm::lessThanEqual(p, reachHigh));
    }
};
/// `tellsAllApart`: as fine as vertices lie dense somewhere (small objects far from each other); else as most of them
/// span.
Lattice latticeOf(const MeshSource::Bounds& bounds, bool tellsAllApart = true);
/// Where a vertex lies in the octree of the build, from 0 to `largestKey`: on short lattices the coordinates; on wide
/// ones in logarithms far out, so that no outlier takes the keys' bits from the others.
glm::u64vec3 keyPlace(const Steps& at, const Lattice& lattice);

/// Vertices on the lattice: what is stored of them, and of a wide lattice the upper halves of the coordinates.
struct LatticeVertices {
    std::vector<shared::MeshVertex> low;
    std::vector<glm::ivec3> high;  ///< of each; empty: the coordinates are short
    size_t size() const { return low.size(); }
    Steps at(size_t i) const {
        const shared::MeshVertex& v = low[i];
        if (high.empty()) return {v.x, v.y, v.z};
        const auto joined = [](int upper, int lower) {
            return int64_t{upper} * (int64_t{1} << 32) + static_cast<uint32_t>(lower);
        };
        return {joined(high[i].x, v.x), joined(high[i].y, v.y), joined(high[i].z, v.z)};
    }
    /// Of coordinates that have 32 bits.
    void addShort(const shared::MeshVertex& v, bool isWide) {
        low.push_back(v);
        if (isWide) high.emplace_back(v.x < 0 ? -1 : 0, v.y < 0 ? -1 : 0, v.z < 0 ? -1 : 0);
    }
    void add(const LatticeVertices& from, size_t i) {
        low.push_back(from.low[i]);
        if (!from.high.empty()) high.push_back(from.high[i]);
    }
};

/// Triangles on the lattice.
struct Soup {
    LatticeVertices vertices;
    std::vector<uint32_t> indices;  ///< 3 a triangle
};
void putSoup(const Soup& soup, ByteWriter& to);
/// The same triangles, equal vertices one, all in an order in which they take few bytes. `dropEqual`: equal triangles
/// once; returns how many went.
uint64_t gather(Soup& soup, bool dropEqual);
/// Appends; false if the bytes are not what putSoup wrote.
bool getSoup(ByteReader& from, Soup& to);

inline constexpr const char* kTooFarOut = "triangles that reach too far out for the others' places";

/// A block of a source on the lattice, without triangles that have no area there or are not finite or reach too far
/// out.
struct PlacedBlock {
    Soup soup;
    std::vector<uint32_t> x, y, z;                       ///< of the triangles' centres: keyPlace
    std::vector<uint64_t> high;                          ///< see Coordinates; empty: none
    uint64_t degenerate = 0, notFinite = 0, tooFar = 0;  ///< tooFar: beyond the lattice's reach
    double rounding = 0;                                 ///< largest of a coordinate, world units
    uint64_t given = 0;                                  ///< triangles, of which these are left
    Coordinates centres() const { return {x, y, z, high}; }
};
/// `positions`: what else vertices have is left out.
enum class Placed { all, positions };
PlacedBlock placeBlock(const TriangleMesh& block, const Lattice& lattice, Executor& executor,
                       Placed what = Placed::all);
/// Of all blocks of a source, in their order, on the calling thread. While one is used or read, another is placed: what
/// comes before an error of the source may not be used any more. Of the first `unplaced` only `given` is known.
Result<void> forPlacedBlocks(const MeshSource& source, const Lattice& lattice, Executor& executor, Placed what,
                             uint64_t unplaced, const std::function<Result<void>(PlacedBlock& block)>& use);

/// Vertices of one cell, each once; triangles of every level of detail index the same ones.
struct WeldedMesh {
    LatticeVertices vertices;
    std::vector<uint32_t> position;  ///< vertex -> number of its position: seams of attributes do not part a surface
    Steps at(uint32_t vertex) const { return vertices.at(vertex); }
    const shared::MeshVertex& vertex(uint32_t v) const { return vertices.low[v]; }
    bool isWide() const { return !vertices.high.empty(); }
};
/// Makes equal vertices of `soup` one. The order of the result hangs on the vertices alone; so does that of the
/// triangles if they are sorted: then they stand along a Morton curve, equal ones once, and `duplicate` counts those.
WeldedMesh weld(Soup& soup);
uint64_t sortTriangles(WeldedMesh& mesh, std::vector<uint32_t>& indices);

/// What a simplification that gave triangles of a cell is known by.
struct Producer {
    uint32_t number = 0;  ///< of its group; of this cell's own kind: see GroupTable::kOwn
    double error = 0;     ///< lattice units
    glm::dvec3 centre{0};
    double radius = 0;
};
constexpr uint32_t kNoProducer = ~0u;

struct Cluster {
    std::vector<uint32_t> indices;  ///< 3 a triangle, into WeldedMesh::vertices
    uint32_t producer = kNoProducer;
    bool isWhole = false;      ///< nothing but small parts that nothing else touches (parts.h)
    bool isContinued = false;  ///< the same part as the cluster before
};

/// Vertices of a list of triangles, numbered from 0.
struct LocalMesh {
    std::vector<uint32_t> global;     ///< local -> WeldedMesh vertex
    std::vector<uint32_t> indices;    ///< local
    std::vector<glm::vec3> position;  ///< from `shift`, where most of them are: there fp32 is exact
    Steps shift{0};
    bool isWide = false;
    std::vector<uint32_t> movedFrom;  ///< of the last vertices: those whose looks they have, at another place
    std::vector<glm::ivec3> movedTo;  ///< where these are: `position` is rounded where a lattice has many bits
    uint32_t firstMoved() const { return static_cast<uint32_t>(position.size() - movedFrom.size()); }
    uint32_t beforeMove(uint32_t v) const { return v < firstMoved() ? v : movedFrom[v - firstMoved()]; }
};
LocalMesh makeLocal(const WeldedMesh& mesh, const std::vector<const Cluster*>& clusters);

/// What the triangles that are cut into clusters are like.
enum class Triangles {
    alongCurve,  ///< they stand along a curve that fills space: runs of them are compact as they are
    ofInput,     ///< the first that are simplified, half of all: such a curve is laid through them
    any          ///< neighbours are put together, at several times the time
};
/// Cuts triangles into clusters of at most kClusterTriangles and kClusterVertices.
void appendClusters(const LocalMesh& local, const std::vector<uint32_t>& indices, Triangles triangles,
                    std::vector<Cluster>& out);
std::vector<Cluster> makeClusters(const WeldedMesh& mesh, const std::vector<uint32_t>& indices, Executor& executor);

/// Groups of about `size` clusters with few edges between groups; deterministic.
std::vector<std::vector<uint32_t>> groupClusters(const WeldedMesh& mesh, const std::vector<Cluster>& clusters,
                                                 uint32_t size, Executor& executor);
/// The same for clusters some of whose triangles are longer than coordinates of 30 bits reach: these are grouped by
/// themselves, or what fp32 rounds of them would be an error of all that is simplified with them.
std::vector<std::vector<uint32_t>> groupApart(const WeldedMesh& mesh, const std::vector<Cluster>& clusters,
                                              uint32_t size, Executor& executor);
/// Triangles that are longer than that behind the others; returns where they begin.
size_t longOnesLast(const WeldedMesh& mesh, std::vector<uint32_t>& indices);

/// Lattice units: the distance between the surface of `local` and its simplification, both ways, and how far a texture
/// is shifted along it where `mesh` is textured. Not below `unimportant`, which saves looking closer. `isBorderKept`:
/// the border of both is the same.
double measureDeviation(const WeldedMesh& mesh, const LocalMesh& local, const std::vector<uint32_t>& coarse,
                        double unimportant, bool isBorderKept);

/// Of each texture the alpha below which materials do not show it; 0: they show all of it.
std::vector<float> cutoffsOf(const StoreDescription& description, size_t textures);
/// Writes all levels of all textures and fills the tables of `h`. Of what has a cutoff all levels show the same share.
Result<void> writeTextures(const std::vector<TextureImage>& images, const std::vector<float>& cutoffs,
                           StoreWriter& writer, Hierarchy& h, Executor& executor);

}  // namespace stipple::lod
