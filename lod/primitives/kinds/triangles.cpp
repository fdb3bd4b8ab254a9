// Triangles: groups of clusters.
#include "lod/cut/frame.h"
#include "lod/primitives/kinds/records.h"
#include "lod/store/check.h"
#include "lod/store/mesh_place.h"
#include "lod/verify/errors.h"
#include "lod/verify/nodes.h"

namespace stipple::lod {
namespace {

Result<Chunk> decode(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count, const std::string& where,
                     bool /*wantLowBits*/) {
    const Payload& p = h.payload(chunk);
    const MeshVertices vertices = !h.isGraph || h.rootLog2 <= kShortMeshBits ? MeshVertices::shortOnes
                                  : hasPairs(h.nodes[chunk])                 ? MeshVertices::pairs
                                                                             : MeshVertices::counted;
    return decodeMeshChunk(bytes, count, p.records, h.groups[p.group], vertices, where);
}
uint64_t fewestBytes(const Hierarchy& h, uint32_t chunk) {
    const Payload& p = h.payload(chunk);
    const MeshGroup& g = h.groups[p.group];
    return fewestEncodedBytes(g.vertices, sizeof(shared::MeshVertex)) + uint64_t{p.records} * 4 +
           uint64_t{g.clusters} * sizeof(shared::MeshCluster);
}

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
Result<uint64_t> measure(const Store& store, uint32_t chunk, const Chunk& decoded, uint64_t /*discs*/) {
    return store.hierarchy.isGraph ? measureGroup(store, chunk, decoded) : Result<uint64_t>(0);
}

}  // namespace

constinit const KindTraits trianglesKind{.name = "triangles",
                                         .records = "triangles",
                                         .recordBytes = sizeof(uint32_t),
                                         .cellBits = 0,
                                         .decodedBytes = bytesOfGroup,
                                         .isPossible = isPossibleGroup,
                                         .check = checkGroup,
                                         .measure = measure,
                                         .leafRecords = originalTriangles,
                                         .cutCost = costOfClusters,
                                         .cutEmit = emitClusters};
constinit const CodecTraits trianglesCodec{"meshopt-triangles", Kind::triangles, decode, fewestBytes};

}  // namespace stipple::lod
