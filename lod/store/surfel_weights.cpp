#include "lod/store/surfel_weights.h"

#include "lod/store/attributes.h"

namespace stipple::lod {
namespace {

/// They are coded as one attribute of a byte each.
const std::vector<AttributeInfo>& oneByte() {
    static const std::vector<AttributeInfo> infos = [] {
        std::vector<AttributeInfo> one(1);
        one[0].name = "weights of surfels";
        return one;
    }();
    return infos;
}

}  // namespace

const Stream* weightsOf(const Hierarchy& h, uint32_t chunk) {
    const Payload& p = h.payload(chunk);
    for (uint32_t k = p.firstStream; k < p.firstStream + p.streams; ++k)
        if (h.streams[k].id == StreamId::surfelWeights) return &h.streams[k];
    return nullptr;
}

bool hasWeights(const Hierarchy& h) {
    bool has = false;
    h.forEachPayload(0, [&](uint32_t chunk) { has = has || weightsOf(h, chunk) != nullptr; });
    return has;
}

std::vector<uint8_t> encodeWeights(const std::vector<uint8_t>& codes) { return encodeAttributes(oneByte(), {codes}); }

Result<std::vector<uint8_t>> decodeWeights(const uint8_t* bytes, size_t count, uint32_t records,
                                           const std::string& where) {
    STIPPLE_ASSIGN(std::vector<uint8_t> codes, decodeAttribute(bytes, count, oneByte(), 0, records, where));
    codes.resize(weightBytes(records));
    return codes;
}

}  // namespace stipple::lod
