#include "lod/primitives/kinds.h"

#include <array>

#include "lod/cut/frame.h"
#include "lod/store/check.h"
#include "lod/verify/errors.h"
#include "lod/verify/nodes.h"

namespace stipple::lod {
namespace {

// ---- points and curves

template <typename Record>
uint64_t bytesOfRecords(const Hierarchy& h, uint32_t chunk) {
    return uint64_t{h.payload(chunk).records} * sizeof(Record);
}
bool isAnything(const Hierarchy&, uint32_t) { return true; }
uint64_t recordsOfLeaf(const Hierarchy& h, uint32_t chunk) {
    return h.nodes[h.nodeOf(chunk)].isLeaf() ? h.payload(chunk).records : 0u;
}
Result<uint64_t> measureCurves(const Store& store, uint32_t chunk, const Chunk& decoded, uint64_t /*discs*/) {
    return measureStrands(store, chunk, decoded);
}

// ---- triangles: groups of clusters

uint64_t bytesOfGroup(const Hierarchy& h, uint32_t chunk) {
    const Payload& p = h.payload(chunk);
    const MeshGroup& g = h.groups[p.group];
    return uint64_t{g.vertices} * sizeof(shared::MeshVertex) + uint64_t{p.records} * sizeof(uint32_t) +
           uint64_t{g.clusters} * sizeof(shared::MeshCluster);
}
uint64_t originalTriangles(const Hierarchy& h, uint32_t chunk) {
    if (!h.isGraph) return recordsOfLeaf(h, chunk);
    const MeshGroup& g = h.groups[h.payload(chunk).group];
    uint64_t sum = 0;
    for (const MeshRun& run : std::span(h.runs).subspan(g.firstRun, g.runs))
        sum += run.producer == MeshRun::kOriginal ? run.triangles : 0u;
    return sum;
}
Result<uint64_t> measureTriangles(const Store& store, uint32_t chunk, const Chunk& decoded, uint64_t /*discs*/) {
    return store.hierarchy.isGraph ? measureGroup(store, chunk, decoded) : Result<uint64_t>(0);
}

constexpr std::array<KindTraits, kKinds> kTraits{
    KindTraits{"points", "points", sizeof(shared::PointRecord), 16, bytesOfRecords<shared::PointRecord>, isAnything,
               checkNode, measureErrors, recordsOfLeaf, costOfRecords, emitRecords},
    KindTraits{"curves", "segments", sizeof(shared::StrandSegment), 15, bytesOfRecords<shared::StrandSegment>,
               isAnything, checkNode, measureCurves, recordsOfLeaf, costOfRecords, emitRecords},
    KindTraits{"triangles", "triangles", sizeof(uint32_t), 0, bytesOfGroup, isPossibleGroup, checkGroup,
               measureTriangles, originalTriangles, costOfClusters, emitClusters}};

// ---- how nodes hang together

std::span<const uint32_t> parentOf(const Hierarchy& h, uint32_t node) {
    return {&h.nodes[node].parent, node == 0 ? 0u : 1u};
}
std::span<const uint32_t> parentsOfGroup(const Hierarchy& h, uint32_t node) {
    const MeshGroup& g = h.groups[node];
    return std::span(h.parents).subspan(g.firstParent, g.parents);
}

constexpr ShapeTraits kTree{"octree", parentOf, costOfTree, emitTree},
    kProgressive{"progressive", parentOf, costOfProgressive, emitProgressive},
    kGraph{"graph", parentsOfGroup, costOfGraph, emitGraph};

}  // namespace

const KindTraits& traitsOf(Kind kind) { return kTraits.at(static_cast<size_t>(kind)); }

const ShapeTraits& shapeOf(const Hierarchy& h) { return h.isGraph ? kGraph : h.isProgressive ? kProgressive : kTree; }

uint64_t decodedBytes(const Hierarchy& h, uint32_t chunk) {
    if (h.isTile(chunk)) return uint64_t{shared::kTileEdge} * shared::kTileEdge * sizeof(uint32_t);
    return traitsOf(kindOf(h, chunk)).decodedBytes(h, chunk);
}

}  // namespace stipple::lod
