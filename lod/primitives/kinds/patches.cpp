// Elevation patches: heights over planes. Records are blocks of cells; a payload is drawn whole or not at all.
#include "lod/verify/patches.h"
#include "lod/cut/frame.h"
#include "lod/primitives/kinds/records.h"
#include "lod/primitives/patch_blocks.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/check.h"
#include "lod/store/patch_bytes.h"
#include "shaders/shared/patch_map.h"

namespace stipple::lod {
namespace {

Result<Chunk> decode(const Hierarchy& h, uint32_t chunk, const uint8_t* bytes, size_t count, const std::string& where,
                     bool /*wantLowBits*/) {
    const Payload& payload = h.payload(chunk);
    STIPPLE_ASSIGN(const std::vector<Patch> patches,
                   decodePatches({bytes, count}, where, {payload.records, payload.maps}));
    uint64_t blocks = 0, words = 0;
    for (const Patch& p : patches) {
        if (const std::string fault = patchFault(p); !fault.empty())
            return tl::unexpected(damagedStore(where, "a patch " + fault));
        const uint32_t ofPatch = countBlocks(p);
        blocks += ofPatch;
        words += uint64_t{ofPatch} * shared::mapWords(mapCode(p));
    }
    if (words >> (32 - shared::kMapFirstShift) != 0)
        return tl::unexpected(damagedStore(where, "maps of too many texels"));
    if (blocks != payload.records) return tl::unexpected(damagedStore(where, "another number of blocks"));
    PatchBlocks made = blocksOf(patches);
    Chunk out;
    out.patchBlocks = std::move(made.blocks);
    out.patchPlanes = std::move(made.planes);
    out.patchMaps = std::move(made.maps);
    return out;
}

uint64_t bytesOfBlocks(const Hierarchy& h, uint32_t chunk) {
    const uint64_t materials = h.hasMaterials ? shared::kPatchSamples * sizeof(uint16_t) : 0;
    const uint64_t maps = sizeof(uint32_t) * shared::mapWords(h.payload(chunk).maps);
    return h.payload(chunk).records * (sizeof(shared::PatchBlock) + sizeof(PatchPlane) + materials + maps);
}
/// A block has a cell, and each sample is of four blocks at most.
uint64_t fewestBytes(const Hierarchy& h, uint32_t chunk) {
    constexpr uint64_t kHeight = 2, kNormal = 4, kColour = 3;
    return uint64_t{h.payload(chunk).records} * (kHeight + kNormal + kColour);
}

/// All blocks have one error, and one is too coarse.
bool isPossibleWhole(const Hierarchy& h, uint32_t chunk) {
    const Payload& p = h.payload(chunk);
    return !h.isStochastic && p.parentCounts.lo == p.parentCounts.hi && p.ownCounts.lo == p.ownCounts.hi &&
           p.errorCode == p.ownCounts.hi &&
           (p.maps & ~(shared::kMapDensity | shared::kMapNormals | shared::kMapLight)) == 0;
}

std::string checkPatches(const Hierarchy& h, uint32_t index, const Chunk& chunk) {
    const Payload& payload = h.payload(index);
    const Node& node = h.nodes[h.nodeOf(index)];
    if (chunk.patchBlocks.size() != payload.records) return "another number of blocks";
    if (node.isLeaf() && payload.errorCode != 0) return "a leaf has an error";
    const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
    for (size_t b = 0; b < chunk.patchBlocks.size(); ++b) {
        const shared::PatchBlock& block = chunk.patchBlocks[b];
        const PatchPlane& plane = chunk.patchPlanes[b];
        const glm::dmat3 frame = glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)));
        for (uint32_t s = 0; s < shared::kPatchSamples; ++s) {
            const uint32_t code = block.heights[s / 2] >> (16 * (s % 2)) & 0xffffu;
            if (code == 0) continue;
            const glm::dvec3 at(double{plane.step} * (block.place % 65536 + s % shared::kPatchStride),
                                double{plane.step} * (block.place / 65536 + s / shared::kPatchStride),
                                std::ldexp(code, plane.quantumExponent));
            if (!(glm::length(corner + plane.origin + frame * at - node.centre) <= node.radius * (1 + 1e-9) + 1e-6))
                return "a sample lies out of the bounding sphere";
        }
    }
    if (h.nodeOf(index) == 0) return "";
    const Node& parent = h.nodes[node.parent];
    if (payload.parentCounts.hi != h.errorCodeOf(node.parent)) return "its parent has another error";
    if (payload.errorCode > payload.parentCounts.hi) return "the error is larger than the parent's";
    if (node.sourceCode > payload.parentCounts.hi && !h.hasOneSourceCode)
        return "its distance from the source is larger than the parent's error";
    if (glm::length(node.centre - parent.centre) + node.radius > parent.radius * (1 + 1e-9) + 1e-6)
        return "the bounding sphere is not inside the parent's";
    return "";
}

Result<uint64_t> measure(const Store& store, uint32_t chunk, const Chunk& /*decoded*/, uint64_t discs) {
    return measurePatches(store, chunk, discs);
}

bool isAsked(const Hierarchy& h, const Payload& p, const Asked& asked) {
    return h.countGreater(p.parentCounts, p.records, asked.parentCode) != 0 &&
           (asked.octantMask != 0 || h.countGreater(p.ownCounts, p.records, asked.code) == 0);
}

/// In triangles, of which a block has at most so many.
uint64_t costOfPatches(const Hierarchy& h, uint32_t chunk, const Asked& asked) {
    const Payload& p = h.payload(chunk);
    return isAsked(h, p, asked) ? uint64_t{p.records} * shared::kPatchTriangles : 0;
}

void emitPatches(const CutFrame& frame, uint32_t i, uint32_t chunk, const Asked& asked, Cut& cut) {
    const Hierarchy& h = frame.hierarchyOf(i);
    const Payload& p = h.payload(chunk);
    if (!isAsked(h, p, asked)) return;
    const double delivered = deliveredPixels(slotOf(frame, i), p.errorCode, asked);
    if (asked.octantMask) cut.tauEffective = std::max(cut.tauEffective, delivered);
    tellLeafError(h.nodes[h.nodeOf(chunk)], asked.epsilon, cut);
    cut.draw.push_back({i, h.nodeOf(chunk), chunk, 0, p.records, asked.code, asked.octantMask,
                        static_cast<float>(delivered), 1, shared::kPatchTriangles});
    cut.counters.trianglesDrawn += costOfPatches(h, chunk, asked);
}

}  // namespace

constinit const KindTraits patchesKind{.name = "patches",
                                       .records = "blocks of patches",
                                       .recordBytes = sizeof(shared::PatchBlock) + sizeof(PatchPlane),
                                       .cellBits = 0,
                                       .decodedBytes = bytesOfBlocks,
                                       .isPossible = isPossibleWhole,
                                       .check = checkPatches,
                                       .measure = measure,
                                       .leafRecords = recordsOfLeaf,
                                       .cutCost = costOfPatches,
                                       .cutEmit = emitPatches};
constinit const CodecTraits patchesCodec{"patches", Kind::patches, decode, fewestBytes};

}  // namespace stipple::lod
