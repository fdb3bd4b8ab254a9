#include "lod/builder/octree/assemble.h"

#include <algorithm>
#include <tuple>

#include "lod/builder/counts.h"

namespace stipple::lod {

Hierarchy assemble(const Frame& frame, const std::vector<NodeBatch>& batches) {
    Hierarchy h;
    h.origin = frame.origin;
    h.unit = frame.unit;
    h.rootLog2 = frame.rootLog2;
    h.errors = frame.errors;
    struct At {
        uint32_t batch, index;
        uint8_t level;
        Key key;
    };
    std::vector<At> order;
    for (uint32_t b = 0; b < batches.size(); ++b)
        for (uint32_t i = 0; i < batches[b].nodes.size(); ++i)
            order.push_back({b, i, batches[b].nodes[i].node.level, batches[b].nodes[i].key});
    // Breadth first: by level, then along the Morton curve.
    std::sort(order.begin(), order.end(),
              [](const At& a, const At& b) { return std::tie(a.level, a.key) < std::tie(b.level, b.key); });
    h.nodes.reserve(order.size());
    for (const At& place : order) h.nodes.push_back(batches[place.batch].nodes[place.index].node);
    uint32_t next = 1;
    std::vector<uint32_t> histogram(256);
    for (uint32_t i = 0; i < h.nodes.size(); ++i) {
        Node& node = h.nodes[i];
        if (!node.isLeaf()) {
            node.firstChild = next;
            for (int c = 0; c < __builtin_popcount(node.childMask); ++c) h.nodes[next++].parent = i;
        }
        const NodeBatch& batch = batches[order[i].batch];
        const NodeBatch::Written& w = batch.nodes[order[i].index];
        uint32_t at = w.firstCount;
        for (const auto& [codes, counts] :
             {std::pair{w.parentCodes, &node.parentCounts}, std::pair{w.ownCodes, &node.ownCounts}}) {
            std::fill(histogram.begin(), histogram.end(), 0);
            for (uint32_t k = 0; k < codes; ++k, ++at) histogram[batch.counts[at] >> 24] = batch.counts[at] & 0xffffffu;
            *counts = makeCodeCounts(histogram, node.records, h.greaterThan);
        }
    }
    return h;
}

}  // namespace stipple::lod
