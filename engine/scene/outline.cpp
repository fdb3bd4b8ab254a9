#include "engine/scene/outline.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/scene/camera.h"
#include "lod/store/mesh_place.h"

namespace stipple::scene {
namespace {

constexpr size_t kDirections = 256, kEnoughRecords = 4096, kMostChunks = 32;

/// Evenly spread over the sphere (golden angle).
const std::array<glm::dvec3, kDirections>& directions() {
    static const auto all = [] {
        std::array<glm::dvec3, kDirections> to{};
        for (size_t i = 0; i < kDirections; ++i) {
            const double z = 1 - 2 * (static_cast<double>(i) + 0.5) / kDirections, r = std::sqrt(1 - z * z);
            const double angle = 2.399963229728653 * static_cast<double>(i);
            to.at(i) = {r * std::cos(angle), r * std::sin(angle), z};
        }
        return to;
    }();
    return all;
}

/// Nodes that together show all of a store: as many as it takes for enough records, or as may be read.
std::vector<uint32_t> coarseNodes(const lod::Hierarchy& h) {
    std::vector<uint32_t> front;
    front.push_back(0);
    for (size_t records = h.ownRecordsOf(h.nodes[0]); records < kEnoughRecords;) {
        std::vector<uint32_t> next;
        records = 0;
        for (const uint32_t n : front) {
            const lod::Node& node = h.nodes[n];
            const int children = h.hasChildrenOf(node) ? __builtin_popcount(node.childMask) : 0;
            if (children == 0) next.push_back(n);
            for (int c = 0; c < children; ++c) next.push_back(node.firstChild + static_cast<uint32_t>(c));
        }
        if (next.size() > kMostChunks || next == front) break;
        for (const uint32_t n : next) records += h.nodes[n].records;
        front = std::move(next);
    }
    return front;
}

/// Samples of patches, as far as they are in [lo, hi]: coarse ones reach beyond what they stand for.
void addSamples(const lod::Hierarchy& h, uint32_t index, const lod::Chunk& chunk, const glm::dvec3& lo,
                const glm::dvec3& hi, std::vector<glm::dvec3>& to) {
    const lod::Node& node = h.nodes[h.nodeOf(index)];
    const glm::dvec3 corner = glm::dvec3(node.cell[0], node.cell[1], node.cell[2]) * h.cellSize(node);
    for (size_t b = 0; b < chunk.patchBlocks.size(); ++b) {
        const shared::PatchBlock& block = chunk.patchBlocks[b];
        const lod::PatchPlane& plane = chunk.patchPlanes[b];
        const glm::dmat3 frame = glm::mat3_cast(glm::normalize(glm::dquat(plane.turn)));
        for (uint32_t s = 0; s < shared::kPatchSamples; ++s) {
            const uint32_t code = block.heights[s / 2] >> (16 * (s % 2)) & 0xffffu;
            if (code == 0) continue;
            const double i = block.place % 65536 + s % shared::kPatchStride;
            const double j = block.place / 65536 + s / shared::kPatchStride;
            const glm::dvec3 local(i * double{plane.step}, j * double{plane.step},
                                   std::ldexp(code, plane.quantumExponent));
            to.push_back(glm::clamp(h.origin + h.unit * (corner + plane.origin + frame * local), lo, hi));
        }
    }
}

void addPositions(const lod::Hierarchy& h, uint32_t index, const lod::Chunk& chunk, std::vector<glm::dvec3>& to) {
    const lod::Node &node = h.nodes[h.nodeOf(index)], &group = lod::meshNode(h, h.nodeOf(index));
    const lod::Payload& payload = h.payload(index);
    const glm::dvec3 base = h.recordOrigin(node, payload);
    const double step = h.hasOverlappingCells() ? h.cellSize(node) / 32768 : std::exp2(payload.stepShift);
    const auto add = [&](uint32_t xy, uint32_t z) {
        to.push_back(h.origin + h.unit * (base + step * glm::dvec3(xy & 0xffffu, xy >> 16, z & 0xffffu)));
    };
    for (const shared::PointRecord& r : chunk.records) add(r.positionXY, r.positionZRadiusError);
    for (const shared::CurveSegment& s : chunk.segments) {
        add(s.a.positionXY, s.a.positionZ);
        add(s.b.positionXY, s.b.positionZ);
    }
    for (const shared::MeshCluster& c : chunk.clusters)
        for (uint32_t i = 0; i < lod::verticesOf(group, c); ++i)
            to.push_back(h.origin + h.unit * lod::vertexPlace(group, chunk, c, i));
}

/// Does a node hold triangles or segments of the input itself?
bool holdsInput(const lod::Hierarchy& h, uint32_t node) {
    if (!h.isMesh()) return h.nodes[node].isLeaf();
    const auto* const runs = &h.runs[h.groups[node].firstRun];
    return std::any_of(runs, runs + h.groups[node].runs,
                       [](const lod::MeshRun& r) { return r.producer == lod::MeshRun::kOriginal; });
}

/// Of a mesh or curves: the vertices of those nodes of the input's own triangles or segments that reach farthest, in
/// every few directions. (Coarse nodes would do for less, but finer ones reach farther out, and of curves coarse ones
/// leave most out: of a tree the foot of its trunk.) Empty where too many must be read.
std::vector<glm::dvec3> outlineOfInput(const lod::Store& store) {
    constexpr size_t kMostRead = 256, kStride = 4;
    const lod::Hierarchy& h = store.hierarchy;
    std::vector<uint32_t> leaves;
    for (uint32_t i = 0; i < h.nodes.size(); ++i)
        if (holdsInput(h, i)) leaves.push_back(i);
    std::vector<glm::dvec3> all;
    std::map<uint32_t, std::pair<size_t, size_t>> known;  // node -> its part of `all`
    for (size_t k = 0; k < kDirections; k += kStride) {
        const glm::dvec3& d = directions().at(k);
        std::vector<std::pair<double, uint32_t>> reach;  // no vertex of a node lies farther
        for (const uint32_t i : leaves)
            reach.emplace_back(glm::dot(h.origin + h.unit * h.nodes[i].centre, d) + h.unit * h.nodes[i].radius, i);
        std::make_heap(reach.begin(), reach.end());
        double farthest = -1e300;
        while (!reach.empty() && reach.front().first > farthest) {
            const uint32_t i = reach.front().second;
            std::pop_heap(reach.begin(), reach.end());
            reach.pop_back();
            if (known.count(i) == 0) {
                const auto chunk = known.size() < kMostRead ? lod::readChunk(store, i) : Result<lod::Chunk>();
                if (!chunk || (chunk->vertices.empty() && chunk->segments.empty())) return {};
                const size_t first = all.size();
                addPositions(h, i, *chunk, all);
                known[i] = {first, all.size()};
            }
            for (size_t v = known[i].first; v < known[i].second; ++v)
                farthest = std::max(farthest, glm::dot(all[v], d));
        }
    }
    return all;
}

}  // namespace

std::vector<glm::dvec3> outermost(std::span<const glm::dvec3> points) {
    if (points.size() <= kDirections) return {points.begin(), points.end()};
    std::vector<uint32_t> chosen;
    for (const glm::dvec3& d : directions()) {
        uint32_t best = 0;
        double farthest = -1e300;
        for (uint32_t i = 0; i < points.size(); ++i)
            if (const double at = glm::dot(points[i] - points[0], d); at > farthest) {
                farthest = at;
                best = i;
            }
        chosen.push_back(best);
    }
    std::sort(chosen.begin(), chosen.end());
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
    std::vector<glm::dvec3> out;
    for (const uint32_t i : chosen) out.push_back(points[i]);
    return out;
}

std::vector<glm::dvec3> outlineOf(const lod::Store& store) {
    const lod::Hierarchy& h = store.hierarchy;
    const lod::StoreDescription& d = store.description;
    const auto corners = cornersOf(d.focusMin, d.focusMax);
    const std::vector<glm::dvec3> box(corners.begin(), corners.end());
    std::vector<glm::dvec3> all;
    // (Where some curves are stray, the nodes that reach farthest are theirs.)
    const bool hasStrays = d.focusMin != d.boundsMin || d.focusMax != d.boundsMax;
    if (h.isMesh() || (h.isCurves && !hasStrays)) {
        if (!lod::readWholeTable(store)) return box;  // whoever draws it says why
        all = outlineOfInput(store);
    } else {
        bool isRead = true;
        for (const uint32_t n : coarseNodes(h))
            h.forEachPayload(n, [&](uint32_t index) {
                const auto chunk = lod::readChunk(store, index);
                isRead = isRead && chunk;
                if (chunk) addPositions(h, index, *chunk, all);
                if (chunk) addSamples(h, index, *chunk, d.focusMin, d.focusMax, all);
            });
        if (!isRead) return box;  // whoever draws it says why
    }
    const glm::dvec3 slack = 1e-6 * (d.focusMax - d.focusMin) + glm::dvec3(h.unit);
    std::erase_if(all, [&](const glm::dvec3& p) {
        return glm::any(glm::lessThan(p, d.focusMin - slack)) || glm::any(glm::greaterThan(p, d.focusMax + slack));
    });
    return all.empty() ? box : outermost(all);
}

bool looksZUp(const lod::StoreDescription& d) {
    if (d.up.z > 0.5) return false;
    const glm::dvec3 size = d.focusMax - d.focusMin;
    constexpr double kFlat = 0.4;
    return size.z < kFlat * size.x && size.z < kFlat * size.y;
}

}  // namespace stipple::scene
