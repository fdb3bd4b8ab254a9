// Points: discs with a normal, or none.
#include "lod/cut/frame.h"
#include "lod/primitives/kinds/records.h"
#include "lod/store/check.h"
#include "lod/store/surfel_weights.h"
#include "lod/verify/errors.h"
#include "lod/verify/nodes.h"

namespace stipple::lod {
namespace {

Result<Chunk> decode(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count, const std::string& where,
                     bool wantLowBits) {
    return decodeChunk(bytes, count, h.payload(chunk).records, where, wantLowBits);
}
uint64_t decodedBytesOfPoints(const Hierarchy& h, uint32_t chunk) {
    const uint64_t records = h.payload(chunk).records;
    const bool hasMaterials = h.hasMaterials && h.payload(chunk).attributeBytes > 0;
    return records * (sizeof(shared::PointRecord) + (hasMaterials ? sizeof(uint16_t) : 0)) +
           (weightsOf(h, chunk) != nullptr ? weightBytes(records) : 0);
}
uint64_t fewestBytes(const Hierarchy& h, uint32_t chunk) {
    return fewestEncodedBytes(h.payload(chunk).records, sizeof(shared::PointRecord));
}

}  // namespace

constinit const KindTraits pointsKind{.name = "points",
                                      .records = "points",
                                      .recordBytes = sizeof(shared::PointRecord),
                                      .cellBits = 16,
                                      .decodedBytes = decodedBytesOfPoints,
                                      .isPossible = isAnything,
                                      .check = checkNode,
                                      .measure = measureErrors,
                                      .leafRecords = recordsOfLeaf,
                                      .cutCost = costOfRecords,
                                      .cutEmit = emitRecords};
constinit const CodecTraits pointsCodec{"meshopt-points", Kind::points, decode, fewestBytes};

}  // namespace stipple::lod
