#include "lod/primitives/codecs.h"

#include <array>

#include "lod/store/check.h"
#include "lod/store/mesh_place.h"

namespace stipple::lod {
namespace {

Result<Chunk> decodePoints(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count,
                           const std::string& where, bool wantLowBits) {
    return decodeChunk(bytes, count, h.payload(chunk).records, where, wantLowBits);
}
uint64_t fewestOfPoints(const Hierarchy& h, uint32_t chunk) {
    return fewestEncodedBytes(h.payload(chunk).records, sizeof(shared::PointRecord));
}

Result<Chunk> decodeCurves(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count,
                           const std::string& where, bool /*wantLowBits*/) {
    return decodeStrandChunk(bytes, count, h.payload(chunk).records, where);
}
uint64_t fewestOfCurves(const Hierarchy& h, uint32_t chunk) {
    return fewestEncodedBytes(h.payload(chunk).records, sizeof(shared::StrandSegment));
}

Result<Chunk> decodeTriangles(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count,
                              const std::string& where, bool /*wantLowBits*/) {
    const Payload& p = h.payload(chunk);
    const MeshVertices vertices = !h.isGraph || h.rootLog2 <= kShortMeshBits ? MeshVertices::shortOnes
                                  : hasPairs(h.nodes[chunk])                 ? MeshVertices::pairs
                                                                             : MeshVertices::counted;
    return decodeMeshChunk(bytes, count, p.records, h.groups[p.group], vertices, where);
}
uint64_t fewestOfTriangles(const Hierarchy& h, uint32_t chunk) {
    const Payload& p = h.payload(chunk);
    const MeshGroup& g = h.groups[p.group];
    return fewestEncodedBytes(g.vertices, sizeof(shared::MeshVertex)) + uint64_t{p.records} * 4 +
           uint64_t{g.clusters} * sizeof(shared::MeshCluster);
}

// The vertex codec of meshoptimizer under zstd (lod/store/chunk.h).
constexpr std::array<CodecTraits, kCodecs> kTraits{
    CodecTraits{"meshopt-points", Kind::points, decodePoints, fewestOfPoints},
    CodecTraits{"meshopt-curves", Kind::curves, decodeCurves, fewestOfCurves},
    CodecTraits{"meshopt-triangles", Kind::triangles, decodeTriangles, fewestOfTriangles}};

}  // namespace

const CodecTraits& traitsOf(Codec codec) { return kTraits.at(static_cast<size_t>(codec)); }

}  // namespace stipple::lod
