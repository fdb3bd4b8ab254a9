#include "lod/builder/patch_store/patch_nodes.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "lod/builder/counts.h"
#include "lod/builder/patch_store/node_payload.h"
#include "lod/primitives/patch_map.h"
#include "lod/store/chunk.h"
#include "lod/store/patch_bytes.h"

namespace stipple::lod {
namespace {

void makeSphere(std::span<const Node> children, const NodePatches& made, const glm::dvec3& corner, Node& out) {
    glm::dvec3 lo(1e300), hi(-1e300);
    for (const Node& c : children) {
        lo = glm::min(lo, c.centre - c.radius);
        hi = glm::max(hi, c.centre + c.radius);
    }
    addSamples(made.patches, corner, lo, hi);
    for (const LeftDisc& d : made.left) {
        lo = glm::min(lo, d.place - double{d.radius});
        hi = glm::max(hi, d.place + double{d.radius});
    }
    out.centre = 0.5 * (lo + hi);
    out.radius = farthestSample(made.patches, corner, out.centre);
    for (const Node& c : children) out.radius = std::max(out.radius, glm::length(c.centre - out.centre) + c.radius);
    for (const LeftDisc& d : made.left)
        out.radius = std::max(out.radius, glm::distance(d.place, out.centre) + double{d.radius});
    out.radius *= 1 + 1e-6;
}

/// A node's payloads; the patches', if there are any, are the node's own.
void appendPayloads(const PatchNode& n, const std::vector<uint8_t>& patches, uint32_t blocks,
                    const std::vector<uint8_t>& discs, uint32_t records, uint8_t maps, PatchTable& table) {
    NodeBatch& batch = table.batch;
    NodeBatch::Written w;
    w.node = n.node;
    w.key = n.key;
    w.node.records = blocks > 0 ? blocks : records;
    w.node.chunkOffset = batch.bytes.size();
    w.node.attributeHash = hashBytes(nullptr, 0);
    if (blocks > 0) {
        w.node.maps = maps;
        w.node.chunkBytes = static_cast<uint32_t>(patches.size());
        w.node.chunkHash = hashBytes(patches.data(), patches.size());
        batch.bytes.insert(batch.bytes.end(), patches.begin(), patches.end());
    }
    if (records > 0) {
        table.points.push_back({static_cast<uint32_t>(batch.nodes.size()), blocks == 0 ? 1u : 0u, records,
                                static_cast<uint32_t>(discs.size()), batch.bytes.size(),
                                hashBytes(discs.data(), discs.size())});
        batch.bytes.insert(batch.bytes.end(), discs.begin(), discs.end());
    }
    batch.nodes.push_back(w);
}

using PointsByNode = std::map<std::pair<uint32_t, Key>, PatchTable::Points>;  ///< by level and key

/// Discs are the second payload of nodes that have patches, and the only one of others.
void addPoints(const Frame& on, const PointsByNode& points, Hierarchy& h) {
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        Node& node = h.nodes[n];
        setKind(node, Kind::patches);
        const Key key = mortonCode(node.cell[0], node.cell[1], node.cell[2]) << on.shiftOf(node.level);
        const auto found = points.find({node.level, key});
        if (found == points.end()) continue;
        const uint32_t above = n == 0 ? uint32_t{ErrorScale::kNoParent} : h.nodes[node.parent].errorCode;
        const bool isFirst = found->second.isAlone != 0;
        FurtherPayload further;
        Payload& p = isFirst ? static_cast<Payload&>(node) : further;
        const uint8_t code = node.errorCode;
        p.errorCode = code;
        p.records = found->second.records;
        p.chunkBytes = found->second.bytes;
        p.chunkOffset = found->second.offset;
        p.chunkHash = found->second.hash;
        p.attributeHash = hashBytes(nullptr, 0);
        setKind(p, Kind::points);
        p.stepShift = static_cast<int8_t>(static_cast<int>(h.rootLog2) - node.level - 16);
        std::vector<uint32_t> histogram(256, 0);
        for (const auto& [of, counts] : {std::pair{above, &p.parentCounts}, std::pair{uint32_t{code}, &p.ownCounts}}) {
            std::fill(histogram.begin(), histogram.end(), 0);
            histogram.at(of) = p.records;
            *counts = makeCodeCounts(histogram, p.records, h.greaterThan);
        }
        h.isMixed = true;
        if (isFirst) continue;
        further.node = n;
        node.firstFurther = static_cast<uint32_t>(h.further.size());
        node.furtherPayloads = 1;
        h.further.push_back(further);
    }
}

void markMaterials(const Patch& p, std::array<uint8_t, 256>& has) {
    if (p.materials.empty()) has[0] = 1;
    for (size_t s = 0; s < p.materials.size(); ++s)
        if (p.heights[s] != 0) has.at(p.materials[s]) = 1;
    if (!p.map.hasMaterials) return;
    const MapLevel map = mapOf(p);
    for (size_t t = 0; t < map.colours.size(); ++t)
        if (map.isKnown[t] != 0) has.at(map.colours[t] >> 24) = 1;
}

}  // namespace

uint64_t PatchSums::add(uint64_t at, const std::vector<uint8_t>& bytes) {
    PatchTable table;
    ByteReader from(bytes);
    STIPPLE_CHECK(table.get(from), "the table of a cell");
    for (NodeBatch::Written& w : table.batch.nodes) w.node.chunkOffset += at;
    for (PatchTable::Points& p : table.points) p.offset += at;
    if (table.elements > 0) {
        lo = glm::min(lo, table.lo);
        hi = glm::max(hi, table.hi);
    }
    kept += table.elements;
    duplicate += table.duplicate;
    counts.patches += table.patches;
    counts.samples += table.samples;
    counts.left += table.left;
    counts.discs += table.discs;
    for (size_t m = 0; m < hasMaterial.size(); ++m) hasMaterial.at(m) |= table.hasMaterial.at(m);
    residual = std::max(residual, table.residual);
    beside = std::max(beside, table.beside);
    tables.push_back(std::move(table));
    return tables.size();
}

uint32_t levelOfOwner(const std::vector<Subtree>& subtrees, Key key) {
    const auto next =
        std::upper_bound(subtrees.begin(), subtrees.end(), key, [](Key k, const Subtree& a) { return k < a.key; });
    return next == subtrees.begin() ? 0 : (next - 1)->level;
}

std::function<bool()> forGood(std::function<bool()> isStopped) {
    if (!isStopped) return {};
    return [ask = std::move(isStopped), seen = std::make_shared<std::atomic<bool>>(false)] {
        if (!*seen && ask()) *seen = true;
        return seen->load();
    };
}

PatchNode patchNodeAt(const Frame& frame, uint32_t level, Key key) {
    PatchNode n;
    n.key = key;
    n.node.level = static_cast<uint8_t>(level);
    const Key cell = key >> frame.shiftOf(level);
    n.node.cell = {compactBits(cell), compactBits(cell >> 1), compactBits(cell >> 2)};
    return n;
}

void writePatchNode(const Frame& frame, std::span<const Node> children, NodePatches& made, PatchNode& n,
                    PatchTable& table, std::vector<uint8_t>* patchBytes) {
    Node& out = n.node;
    uint32_t code = frame.errors.encodeUp(out.isLeaf() ? 0.0 : n.error);
    DiscPayload discs;
    if (!made.left.empty()) {
        const std::vector<LeftDisc> asMade = made.left;
        discs = encodeDiscs(made.left, frame, out, code);
        if (out.isLeaf()) {
            n.residual += discs.moved;
        } else if (discs.moved > 0) {  // their error is told in them
            n.error += discs.moved;
            code = frame.errors.encodeUp(n.error);
            made.left = asMade;
            discs = encodeDiscs(made.left, frame, out, code);
        }
    }
    for (const Patch& p : made.patches) markMaterials(p, table.hasMaterial);
    if (out.isLeaf()) {
        table.residual = std::max(table.residual, n.residual);
        STIPPLE_CHECK(n.residual <= frame.errors.decode(ErrorScale::kLargest), "a leaf is farther off than codes tell");
        out.sourceCode = static_cast<uint8_t>(std::max(frame.errors.encodeUp(n.residual), 1u));
    }
    STIPPLE_CHECK(out.isLeaf() || n.error <= frame.errors.decode(ErrorScale::kLargest),
                  "no code tells of such an error");
    out.errorCode = static_cast<uint8_t>(code);
    makeSphere(children, made, cornerOf(frame, out), out);
    std::vector<uint8_t> patches = encodePatches(made.patches).bytes;
    appendPayloads(n, patches, blocksIn(made.patches), discs.bytes, static_cast<uint32_t>(made.left.size()),
                   mapCodeOf(made.patches), table);
    if (patchBytes != nullptr) *patchBytes = std::move(patches);
}

Hierarchy hierarchyOf(const Frame& frame, std::vector<PatchTable> tables) {
    std::map<std::pair<uint32_t, Key>, uint8_t> codes;  // by level and key
    for (const PatchTable& table : tables)
        for (const NodeBatch::Written& w : table.batch.nodes) codes[{w.node.level, w.key}] = w.node.errorCode;
    PointsByNode points;
    std::vector<NodeBatch> batches;
    for (PatchTable& table : tables) {
        for (NodeBatch::Written& w : table.batch.nodes) {
            const uint32_t level = w.node.level;
            uint32_t above = ErrorScale::kNoParent;
            if (level > 0) {
                const uint32_t shift = frame.shiftOf(level - 1);
                above = codes.at({level - 1, w.key >> shift << shift});
            }
            w.firstCount = static_cast<uint32_t>(table.batch.counts.size());
            w.parentCodes = w.ownCodes = 1;
            table.batch.addCount(above, w.node.records);
            table.batch.addCount(w.node.errorCode, w.node.records);
        }
        for (const PatchTable::Points& p : table.points) {
            const NodeBatch::Written& w = table.batch.nodes[p.node];
            points[{w.node.level, w.key}] = p;
        }
        batches.push_back(std::move(table.batch));
    }
    tables = {};
    Hierarchy h = assemble(frame, batches);
    addPoints(frame, points, h);
    return h;
}

void PatchTable::put(ByteWriter& to) const {
    to.put(batch.nodes);
    to.put(points);
    to.put(elements);
    to.put(duplicate);
    to.put(left);
    to.put(patches);
    to.put(samples);
    to.put(discs);
    to.put(hasMaterial);
    to.put(residual);
    to.put(beside);
    to.put(lo);
    to.put(hi);
}
bool PatchTable::get(ByteReader& from) {
    from.get(batch.nodes);
    from.get(points);
    from.get(elements);
    from.get(duplicate);
    from.get(left);
    from.get(patches);
    from.get(samples);
    from.get(discs);
    from.get(hasMaterial);
    from.get(residual);
    from.get(beside);
    from.get(lo);
    from.get(hi);
    return from.isWhole();
}

}  // namespace stipple::lod
