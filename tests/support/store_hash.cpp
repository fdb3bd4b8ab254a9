#include "tests/support/store_hash.h"

#include <stdexcept>

#include "engine/base/hash.h"

namespace stipple::test {
namespace {

template <typename T>
void add(uint64_t& hash, const std::vector<T>& values) {
    const uint64_t count = values.size();
    hash = hashBytes(&count, sizeof(count), hash);
    hash = hashBytes(values.data(), values.size() * sizeof(T), hash);
}

template <typename... T>
void addFields(uint64_t& hash, const T&... fields) {
    ((hash = hashBytes(&fields, sizeof(fields), hash)), ...);
}

}  // namespace

uint64_t hashRecords(const lod::Store& store) {
    uint64_t hash = 0;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t i = 0; i < h.chunks(); ++i) {
        const auto chunk = lod::readChunk(store, i, true);
        if (!chunk) throw std::runtime_error(chunk.error().line());
        add(hash, chunk->records);
        add(hash, chunk->lowBits);
        add(hash, chunk->vertices);
        add(hash, chunk->triangles);
        add(hash, chunk->clusters);
        add(hash, chunk->segments);
        add(hash, chunk->texels);
        if (!chunk->patchBlocks.empty()) {
            add(hash, chunk->patchBlocks);
            add(hash, chunk->patchMaps);
            add(hash, chunk->materials);
        }
        if (i == 0 && h.overviewOf(h.nodes[0]) > 0) {
            const auto drawn = lod::readDrawnChunk(store, i, true);
            if (!drawn) throw std::runtime_error(drawn.error().line());
            add(hash, drawn->records);
            add(hash, drawn->lowBits);
        }
        if (h.isTile(i) || h.payload(i).attributeBytes == 0) continue;
        for (size_t k = 0; k < store.description.attributes.size(); ++k) {
            const auto values = lod::readAttribute(store, i, k);
            if (!values) throw std::runtime_error(values.error().line());
            add(hash, *values);
        }
    }
    return hash;
}

uint64_t hashTable(const lod::Store& store) {
    const lod::Hierarchy& h = store.hierarchy;
    uint64_t hash = 0;
    addFields(hash, h.origin, h.unit, h.rootLog2, h.errors.smallest);
    for (const lod::Node& n : h.nodes)
        addFields(hash, n.centre, n.radius, n.parent, n.firstChild, n.records, n.cell, n.level, n.childMask,
                  n.errorCode, n.stepShift, n.normalCone, n.normalConeCosine);
    for (const lod::FurtherPayload& p : h.further) addFields(hash, p.node, p.kind, p.records, p.errorCode, p.stepShift);
    return hash;
}

}  // namespace stipple::test
