#include "lod/kinds.h"

#include <array>

#include "lod/cut_frame.h"
#include "lod/mesh_place.h"
#include "lod/verify_errors.h"
#include "lod/verify_nodes.h"

namespace stipple::lod {
namespace {

// ---- points and curves: records of an octree

template <typename Record>
uint64_t bytesOfRecords(const Hierarchy& h, uint32_t node) {
    return uint64_t{h.nodes[node].records} * sizeof(Record);
}
std::span<const uint32_t> parentOf(const Hierarchy& h, uint32_t node) {
    return {&h.nodes[node].parent, node == 0 ? 0u : 1u};
}
uint64_t recordsOfLeaf(const Hierarchy& h, uint32_t node) {
    return h.nodes[node].isLeaf() ? h.nodes[node].records : 0u;
}
Result<Chunk> decodePoints(const Hierarchy& h, uint32_t node, const uint8_t* bytes, size_t count,
                           const std::string& where, bool wantLowBits) {
    return decodeChunk(bytes, count, h.nodes[node].records, where, wantLowBits);
}
Result<Chunk> decodeCurves(const Hierarchy& h, uint32_t node, const uint8_t* bytes, size_t count,
                           const std::string& where, bool /*wantLowBits*/) {
    return decodeStrandChunk(bytes, count, h.nodes[node].records, where);
}
Result<uint64_t> measureCurves(const Store& store, uint32_t node, const Chunk& chunk, uint64_t /*discs*/) {
    return measureStrands(store, node, chunk);
}

// ---- triangles: groups of clusters

uint64_t bytesOfGroup(const Hierarchy& h, uint32_t node) {
    const MeshGroup& g = h.groups[node];
    return uint64_t{g.vertices} * sizeof(shared::MeshVertex) + uint64_t{h.nodes[node].records} * sizeof(uint32_t) +
           uint64_t{g.clusters} * sizeof(shared::MeshCluster);
}
std::span<const uint32_t> parentsOfGroup(const Hierarchy& h, uint32_t node) {
    const MeshGroup& g = h.groups[node];
    return std::span(h.parents).subspan(g.firstParent, g.parents);
}
uint64_t originalTriangles(const Hierarchy& h, uint32_t node) {
    const MeshGroup& g = h.groups[node];
    uint64_t sum = 0;
    for (const MeshRun& run : std::span(h.runs).subspan(g.firstRun, g.runs))
        sum += run.producer == MeshRun::kOriginal ? run.triangles : 0u;
    return sum;
}
Result<Chunk> decodeTriangles(const Hierarchy& h, uint32_t node, const uint8_t* bytes, size_t count,
                              const std::string& where, bool /*wantLowBits*/) {
    const MeshVertices vertices = h.rootLog2 <= kShortMeshBits ? MeshVertices::shortOnes
                                  : hasPairs(h.nodes[node])    ? MeshVertices::pairs
                                                               : MeshVertices::counted;
    return decodeMeshChunk(bytes, count, h.nodes[node].records, h.groups[node], vertices, where);
}
Result<uint64_t> measureTriangles(const Store& store, uint32_t node, const Chunk& chunk, uint64_t /*discs*/) {
    return measureGroup(store, node, chunk);
}

constexpr std::array<KindTraits, kKinds> kTraits{
    KindTraits{"points", sizeof(shared::PointRecord), bytesOfRecords<shared::PointRecord>, parentOf, decodePoints,
               checkNode, measureErrors, recordsOfLeaf, costOfPoints, emitPoints},
    KindTraits{"curves", sizeof(shared::StrandSegment), bytesOfRecords<shared::StrandSegment>, parentOf, decodeCurves,
               checkNode, measureCurves, recordsOfLeaf, costOfPoints, emitPoints},
    KindTraits{"triangles", sizeof(uint32_t), bytesOfGroup, parentsOfGroup, decodeTriangles, checkGroup,
               measureTriangles, originalTriangles, costOfTriangles, emitTriangles}};

}  // namespace

const KindTraits& traitsOf(Kind kind) { return kTraits.at(static_cast<size_t>(kind)); }

uint64_t decodedBytes(const Hierarchy& h, uint32_t chunk) {
    if (chunk >= h.nodes.size()) return uint64_t{shared::kTileEdge} * shared::kTileEdge * sizeof(uint32_t);
    return traitsOf(h).decodedBytes(h, chunk);
}

}  // namespace stipple::lod
