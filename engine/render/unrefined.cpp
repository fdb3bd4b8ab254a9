#include "engine/render/unrefined.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace stipple::render {
namespace {

/// Can a node of points be left as it is, by the cut of its store? Of one that has other payloads, too, these may be
/// seen.
bool isOctreeOfPoints(const lod::Hierarchy& h) {
    return !h.isMixed && !h.isStochastic && !h.isMesh() && h.nodes[0].kind == lod::Kind::points;
}

using Nodes = std::vector<lod::PlacedNode>;
bool has(const Nodes& sorted, const lod::PlacedNode& n) { return std::binary_search(sorted.begin(), sorted.end(), n); }

Nodes unite(const Nodes& a, const Nodes& b) {
    Nodes all;
    std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
    return all;
}
Nodes without(const Nodes& a, const Nodes& b) {
    Nodes left;
    std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(left));
    return left;
}

}  // namespace

void addErrors(std::span<const lod::Hierarchy* const> hierarchies, std::span<const lod::Instance> instances,
               DrawList& draws) {
    const DrawBatch& points = draws.points();
    for (size_t n = 0; n < draws.pointBounds.size(); ++n) {
        const lod::Instance& instance = instances[points.instances[n]];
        const lod::Hierarchy& h = *hierarchies[instance.hierarchy];
        float& error = draws.pointBounds[n].error;
        if (!isOctreeOfPoints(h)) {
            error = std::numeric_limits<float>::infinity();  // it is not known
            continue;
        }
        const lod::Node& node = h.nodes[points.keys[n].chunk];
        const shared::DrawNode& drawn = points.nodes[n];
        // Levels of an overview have larger errors than the root's own records, and no larger ones than are allowed.
        const uint32_t overview = drawn.count <= h.overviewOf(node) ? drawn.errorCode : 0u;
        const uint32_t code = std::max({uint32_t{node.errorCode}, uint32_t{node.sourceCode}, overview});
        if (code >= lod::ErrorScale::kLargest) {
            error = std::numeric_limits<float>::infinity();  // the last code stands for whatever is larger
            continue;
        }
        const double own = h.errors.decode(code);
        error = static_cast<float>(1.001 * (own * h.unit * instance.scale + instance.inputError + instance.sway));
    }
}

void Unrefined::clear() { *this = {}; }

void Unrefined::beginView(const lod::View& view) {
    if (hasView_ && view_ == view) return;
    if (hasView_) nodes_ = drawn_;  // what is out of view may be anything when it comes back
    view_ = view;
    hasView_ = true;
    seen_.clear();
    gains_ = 0;
}

void Unrefined::take(const Backend& backend, const DrawList& draws) {
    const std::vector<uint32_t>* const hidden = backend.hiddenNodes();
    isKnown_ = hidden != nullptr;
    hidden_.clear();
    if (!isKnown_) return;
    const DrawBatch& points = draws.points();
    uint64_t all = 0, more = 0;
    for (const uint32_t records : points.records) all += records;
    for (const uint32_t n : *hidden) {
        hidden_.push_back({points.instances[n], points.keys[n].chunk});
        more += has(nodes_, hidden_.back()) ? 0 : points.records[n];
    }
    std::sort(hidden_.begin(), hidden_.end());
    newShare_ = all == 0 ? 0 : static_cast<double>(more) / static_cast<double>(all);
}

bool Unrefined::learn(const lod::Cut& cut, bool isShort) {
    drawn_.clear();
    for (const lod::CutDraw& draw : cut.draw)
        if (const lod::PlacedNode node{draw.instance, draw.node}; has(nodes_, node)) drawn_.push_back(node);
    std::sort(drawn_.begin(), drawn_.end());
    const Nodes seen = isKnown_ ? without(drawn_, hidden_) : drawn_;
    lastSeen_ = seen.size();
    seen_ = unite(seen_, seen);
    const bool gains = isKnown_ && isShort && gains_ < kGains && newShare_ > kLeastShare;
    if (!gains && seen.empty()) return false;
    gains_ += gains ? 1 : 0;
    nodes_ = without(gains ? unite(nodes_, hidden_) : nodes_, seen_);
    drawn_ = without(drawn_, seen);
    return true;
}

}  // namespace stipple::render
