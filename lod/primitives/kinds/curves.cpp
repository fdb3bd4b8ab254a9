// Curves: ribbons and tubes, as segments.
#include "lod/cut/frame.h"
#include "lod/primitives/kinds/records.h"
#include "lod/store/check.h"
#include "lod/verify/errors.h"
#include "lod/verify/nodes.h"

namespace stipple::lod {
namespace {

Result<Chunk> decode(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count, const std::string& where,
                     bool /*wantLowBits*/) {
    return decodeCurveChunk(bytes, count, h.payload(chunk).records, where);
}
uint64_t fewestBytes(const Hierarchy& h, uint32_t chunk) {
    return fewestEncodedBytes(h.payload(chunk).records, sizeof(shared::CurveSegment));
}

Result<uint64_t> measure(const Store& store, uint32_t chunk, const Chunk& decoded, uint64_t /*discs*/) {
    return measureCurves(store, chunk, decoded);
}

}  // namespace

constinit const KindTraits curvesKind{.name = "curves",
                                      .records = "segments",
                                      .recordBytes = sizeof(shared::CurveSegment),
                                      .cellBits = 15,
                                      .decodedBytes = bytesOfRecords<shared::CurveSegment>,
                                      .isPossible = isAnything,
                                      .check = checkNode,
                                      .measure = measure,
                                      .leafRecords = recordsOfLeaf,
                                      .cutCost = costOfRecords,
                                      .cutEmit = emitRecords};
constinit const CodecTraits curvesCodec{"meshopt-curves", Kind::curves, decode, fewestBytes};

}  // namespace stipple::lod
