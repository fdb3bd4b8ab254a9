#include "lod/store/nearest.h"

#include <algorithm>
#include <limits>
#include <queue>

#include "lod/store/attributes.h"

namespace stipple::lod {
namespace {

/// Nearest first by the distance of a node's sphere.
struct Candidate {
    double distance;
    uint32_t node;
    bool operator<(const Candidate& other) const {
        return distance != other.distance ? distance > other.distance : node > other.node;
    }
};

}  // namespace

Result<NearestPoint> findNearest(const Store& store, const glm::dvec3& place) {
    STIPPLE_TRY(readWholeTable(store));
    const Hierarchy& h = store.hierarchy;
    const glm::dvec3 target = (place - h.origin) / h.unit;
    const auto toSphere = [&](const Node& n) { return std::max(0.0, glm::length(n.centre - target) - n.radius); };
    std::priority_queue<Candidate> open;
    open.push({toSphere(h.nodes[0]), 0});
    NearestPoint best;
    best.distance = std::numeric_limits<double>::infinity();
    while (!open.empty() && open.top().distance < best.distance) {
        const uint32_t index = open.top().node;
        open.pop();
        const Node& node = h.nodes[index];
        if (!node.isLeaf()) {
            const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
            for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c)
                open.push({toSphere(h.nodes[c]), c});
            continue;
        }
        STIPPLE_ASSIGN(const Chunk chunk, readChunk(store, index, true));
        const auto size = static_cast<uint64_t>(h.cellSize(node));
        for (uint32_t i = 0; i < chunk.records.size(); ++i) {
            const shared::PointRecord& r = chunk.records[i];
            const std::array<uint64_t, 3> q{shared::recordX(r), shared::recordY(r), shared::recordZ(r)};
            std::array<uint64_t, 3> lattice{};
            glm::dvec3 p(0);
            for (size_t a = 0; a < 3; ++a) {
                const uint64_t low = chunk.lowBits.empty() ? 0 : chunk.lowBits[size_t{i} * 3 + a];
                const uint64_t local =
                    node.stepShift >= 0 ? q.at(a) << node.stepShift | low : q.at(a) >> -node.stepShift;
                lattice.at(a) = node.cell.at(a) * size + local;
                p[static_cast<int>(a)] = static_cast<double>(lattice.at(a));
            }
            const double distance = glm::length(p - target);
            if (distance >= best.distance) continue;
            best = {index, i, lattice, h.origin + h.unit * p, distance, r, {}};
        }
    }
    for (size_t a = 0; a < store.description.attributes.size(); ++a) {
        const AttributeInfo& info = store.description.attributes[a];
        STIPPLE_ASSIGN(const std::vector<uint8_t> values, readAttribute(store, best.node, a));
        best.attributes.push_back(attributeValue(info, values.data() + best.record * bytesOf(info.type)));
    }
    best.distance *= h.unit;
    return best;
}

Result<double> largestLeafRadius(const Store& store) {
    STIPPLE_TRY(readWholeTable(store));
    double largest = 0;
    const Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        STIPPLE_ASSIGN(const Chunk chunk, readChunk(store, n));
        uint32_t code = 0;
        for (const auto& r : chunk.records) code = std::max(code, shared::recordRadiusCode(r));
        largest =
            std::max(largest, h.unit * h.cellSize(h.nodes[n]) * static_cast<double>(shared::radiusFraction(code)));
    }
    return largest;
}

}  // namespace stipple::lod
