#include "lod/verify/nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "lod/cut/view.h"
#include "lod/store/mesh_place.h"

namespace stipple::lod {
namespace {

/// What the cut relies on, of a point or of a segment.
struct RecordFacts {
    uint32_t code, octants;            ///< own error; octants whose children it stands for
    std::array<glm::dvec3, 2> places;  ///< ends, lattice units
    std::array<double, 2> radii;
};

/// What a node's records hold.
class NodeRecords {
  public:
    NodeRecords(const Hierarchy& h, const Node& node, const Payload& payload, const Chunk& chunk)
        : chunk_(chunk),
          step_(std::exp2(payload.stepShift)),
          edge_(h.cellSize(node)),
          base_(h.recordOrigin(node, payload)) {}
    uint32_t codeOf(size_t i) const {
        return chunk_.segments.empty() ? shared::recordErrorCode(chunk_.records[i])
                                       : shared::segmentErrorCode(chunk_.segments[i]);
    }
    RecordFacts factsOf(size_t i) const {
        if (chunk_.segments.empty()) {
            const shared::PointRecord& r = chunk_.records[i];
            const glm::dvec3 p = base_ + step_ * glm::dvec3(shared::recordX(r), shared::recordY(r), shared::recordZ(r));
            const double radius = edge_ * static_cast<double>(shared::radiusFraction(shared::recordRadiusCode(r)));
            return {codeOf(i), 1u << shared::recordOctant(r), {p, p}, {radius, radius}};
        }
        const shared::CurveSegment& s = chunk_.segments[i];
        RecordFacts facts{codeOf(i), shared::segmentOctants(s), {}, {}};
        for (size_t k = 0; k < 2; ++k) {
            const shared::CurveVertex& v = k == 0 ? s.a : s.b;
            facts.places.at(k) =
                base_ + step_ * glm::dvec3(v.positionXY & 0xffffu, v.positionXY >> 16, v.positionZ & 0xffffu);
            facts.radii.at(k) = edge_ * static_cast<double>(shared::curveRadius(v, 1.0f));
        }
        return facts;
    }

  private:
    const Chunk& chunk_;
    double step_, edge_;
    glm::dvec3 base_;
};

glm::dvec3 coneAxis(const Node& node) { return glm::normalize(glm::dvec3(shared::octDecode(node.normalCone))); }
double coneAngle(const Node& node) { return std::acos(std::min(double{node.normalConeCosine}, 1.0)); }

/// Cones hide all that is below their node (facesAway), so each must be inside of those above it. kConeMargin is for
/// the rounding of records' normals alone.
bool isConeInside(const Node& node, const Node& parent) {
    if (!(parent.normalConeCosine > 0)) return true;
    constexpr double kRounding = 1e-7;  // radians, of axes in single precision; builders widen by more
    const double sine = 0.5 * glm::length(coneAxis(node) - coneAxis(parent));
    return 2 * std::asin(std::min(sine, 1.0)) + coneAngle(node) <= coneAngle(parent) + kRounding;
}

/// One level of an overview is drawn, or what is below it: records of a level have one error, which is that of the next
/// finer one's parents.
std::string checkOverview(const Hierarchy& h, const Payload& payload, const NodeRecords& records) {
    const uint32_t overview = h.overviewOf(payload);
    for (uint32_t begin = 0, end = 0; begin < overview; begin = end) {
        const uint32_t code = records.codeOf(begin);
        while (end < overview && records.codeOf(end) == code) ++end;
        // Those with parents of this error, or less, begin where it ends.
        if (h.countGreater(payload.parentCounts, payload.records, code) != end)
            return "a level of the overview does not give way to the next coarser one";
        const uint32_t next = end < overview ? records.codeOf(end) : payload.errorCode;
        if (next >= code) return "the errors of the overview are in the wrong order";
        // (Of the finest: those of the root itself are all that is left.)
        if (end == overview && h.countGreater(payload.parentCounts, payload.records, code - 1) != payload.records)
            return "the root's own records do not give way to the overview";
    }
    return {};
}

}  // namespace

std::string checkNode(const Hierarchy& h, uint32_t index, const Chunk& chunk) {
    const Payload& payload = h.payload(index);
    const uint32_t number = h.nodeOf(index);
    const Node& node = h.nodes[number];
    const NodeRecords records(h, node, payload, chunk);
    std::array<uint32_t, 256> own{};
    uint32_t largest = 0;
    const uint32_t overview = h.overviewOf(payload);
    if (overview > 0 && (number != 0 || overview >= payload.records))
        return "records of an overview stand where there can be none";
    for (uint32_t i = 0; i < payload.records; ++i) {
        const RecordFacts r = records.factsOf(i);
        ++own.at(r.code);
        if (i < overview) {  // they stand for all, wherever that lies
            if (r.code <= payload.errorCode) return "a record of the overview has no larger error than the others";
            for (const glm::dvec3& p : r.places)
                if (!(glm::length(p - node.centre) <= node.radius * (1 + 1e-9) + 2 * std::exp2(payload.stepShift)))
                    return "a record of the overview is outside the bounding sphere";
            continue;
        }
        largest = std::max(largest, r.code);
        for (size_t k = 0; k < 2; ++k)
            if (!(glm::length(r.places.at(k) - node.centre) + r.radii.at(k) <= node.radius * (1 + 1e-9) + 1e-6))
                return "a record reaches out of the bounding sphere";
        // Only exact records may stand in an octant without a child.
        if (!h.isStochastic && r.code > 0 && node.childMask != 0 && (r.octants & ~uint32_t{node.childMask}) != 0)
            return "a record has an error but its octant has no child";
    }
    if (!h.hasOverlappingCells() && node.normalConeCosine > 0) {  // see facesAway
        const glm::dvec3 axis = coneAxis(node);
        const double widest = coneAngle(node) + kConeMargin;
        for (const shared::PointRecord& r : std::span(chunk.records).subspan(overview)) {
            if ((shared::recordFlags(r) & (shared::kFlagTwoSided | shared::kFlagNoNormal)) != 0)
                return "a record can be seen from everywhere, but the node has a cone of normals";
            const glm::dvec3 n = glm::normalize(glm::dvec3(shared::octDecode(r.normal)));
            if (std::acos(std::clamp(glm::dot(axis, n), -1.0, 1.0)) > widest)
                return "a normal is outside the node's cone";
        }
    }
    if (!h.isStochastic && node.isLeaf() && largest != 0) return "a leaf record has an error";
    if (largest != payload.errorCode) return "the largest error is not the one in the node table";
    uint32_t left = payload.records;
    for (uint32_t code = 0; code < 256; ++code) {
        left -= own[code];
        if (h.countGreater(payload.ownCounts, payload.records, code) != left)
            return "the counts per error code are wrong";
    }
    // Monotone along every chain: sorted by the parent's code, so the own code must not exceed it.
    uint32_t position = 0;
    for (int code = 255; code >= 0; --code) {
        const uint32_t atLeast =
            code == 0 ? payload.records
                      : h.countGreater(payload.parentCounts, payload.records, static_cast<uint32_t>(code) - 1);
        for (; position < atLeast; ++position)
            if (records.codeOf(position) > static_cast<uint32_t>(code))
                return "a record has a larger error than its parent record";
    }
    if (std::string text = checkOverview(h, payload, records); !text.empty()) return text;
    if (number == 0) return {};
    const Node& parent = h.nodes[node.parent];
    if (glm::length(node.centre - parent.centre) + node.radius > parent.radius * (1 + 1e-9) + 1e-6)
        return "the bounding sphere is not inside the parent's";
    if (!h.hasOverlappingCells() && !isConeInside(node, parent))
        return "the cone of normals is not inside the parent's";
    if (payload.errorCode > h.errorCodeOf(node.parent)) return "the error is larger than the parent's";
    return {};
}

namespace {

/// Of triangles of an octree: what replaces them has smaller errors, and lies inside.
std::string checkTriangles(const Hierarchy& h, uint32_t index) {
    const uint32_t number = h.nodeOf(index);
    const Payload& payload = h.payload(index);
    const Node& node = h.nodes[number];
    if (node.isLeaf() && payload.errorCode > 0) return "triangles of a leaf have an error";
    if (payload.errorCode > payload.parentCounts.hi) return "triangles have a larger error than what they replace";
    for (const MeshRun& run : std::span(h.runs).subspan(h.groups[payload.group].firstRun, h.groups[payload.group].runs))
        if (payload.errorCode > 0 && (node.childMask >> run.producer & 1u) == 0)
            return "triangles have an error but their octant has no child";
    if (number == 0) return {};
    const Node& parent = h.nodes[node.parent];
    if (glm::length(node.centre - parent.centre) + node.radius > parent.radius * (1 + 1e-9) + 1e-6)
        return "the bounding sphere is not inside the parent's";
    if (payload.errorCode > h.errorCodeOf(node.parent)) return "the error is larger than the parent's";
    return {};
}

}  // namespace

std::string checkGroup(const Hierarchy& h, uint32_t index, const Chunk& chunk) {
    const Payload& payload = h.payload(index);
    const Node &node = h.nodes[h.nodeOf(index)], &place = meshNode(h, h.nodeOf(index));
    const MeshGroup& group = h.groups[payload.group];
    if (node.normalConeCosine > 0) return "a group of the mesh has a cone of normals";
    for (const shared::MeshCluster& c : chunk.clusters)
        for (uint32_t i = 0; i < verticesOf(place, c); ++i)
            if (glm::length(vertexPlace(place, chunk, c, i) - node.centre) > node.radius * (1 + 1e-9))
                return "a vertex reaches out of the bounding sphere";
    uint32_t cluster = 0;
    for (uint32_t r = 0; r < group.runs; ++r) {
        const MeshRun& run = h.runs[group.firstRun + r];
        uint32_t triangles = 0;
        for (uint32_t c = 0; c < run.clusters; ++c, ++cluster) triangles += chunk.clusters.at(cluster).counts >> 16;
        if (triangles != run.triangles) return "a run has not its number of triangles";
    }
    if (!h.isGraph) return checkTriangles(h, index);
    for (uint32_t k = 0; k < group.parents; ++k) {
        const Node& parent = h.nodes[h.parents[group.firstParent + k]];
        if (glm::length(node.centre - parent.centre) + node.radius > parent.radius * (1 + 1e-9))
            return "the bounding sphere is not inside a parent's";
        if (node.errorCode > parent.errorCode) return "the error is larger than a parent's";
    }
    return {};
}

}  // namespace stipple::lod
