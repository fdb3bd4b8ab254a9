#include "lod/builder/points/upper.h"

#include <algorithm>

#include "engine/base/check.h"

namespace stipple::lod {

void UpperTree::closeLast(NodeBatch& batch) {
    const uint32_t level = open_.back().node.level, shift = frame_.shiftOf(level - 1);
    const Key parent = open_.back().key >> shift;
    size_t first = open_.size();
    while (first > 0 && open_[first - 1].key >> shift == parent) --first;
    const std::span<PendingNode> children = std::span(open_).subspan(first);
    for (const PendingNode& c : children) STIPPLE_CHECK(c.node.level == level, "children of one level");
    PendingNode node = makeParent(frame_, children, batch, nullptr);
    open_.resize(first);
    unchanged_ = std::min(unchanged_, first);
    open_.push_back(std::move(node));
}

void UpperTree::closeBefore(Key key, NodeBatch& batch) {
    while (!open_.empty() && open_.back().node.level > 0) {
        const uint32_t shift = frame_.shiftOf(open_.back().node.level - 1u);
        if (open_.back().key >> shift == key >> shift) return;
        closeLast(batch);
    }
}

void UpperTree::finish(NodeBatch& batch) {
    while (open_.back().node.level > 0) closeLast(batch);
    STIPPLE_CHECK(open_.size() == 1, "one root");
    finishRoot(frame_, open_.back(), batch);
    open_.clear();
}

namespace {

template <typename Archive, typename Pending>
void visit(Archive& archive, Pending& p) {
    const auto with = [&](auto&& value) {
        if constexpr (std::is_same_v<Archive, ByteWriter>)
            archive.put(value);
        else
            archive.get(value);
    };
    with(p.node);
    with(p.key);
    with(p.records);
    with(p.values);
    auto& points = p.own.points;
    for (auto* column : {&points.x, &points.y, &points.z, &points.colour, &points.normal}) with(*column);
    with(points.high);
    with(points.radius);
    with(points.attributes);
    with(p.own.key);
    with(p.leafParentCode);
}

}  // namespace

void putPending(const PendingNode& node, ByteWriter& to) { visit(to, node); }
void getPending(ByteReader& from, PendingNode& node) { visit(from, node); }

void UpperTree::saveChanges(ByteWriter& to) {
    to.put(uint64_t{unchanged_});
    to.put(uint64_t{open_.size() - unchanged_});
    for (; unchanged_ < open_.size(); ++unchanged_) visit(to, open_[unchanged_]);
}

void UpperTree::loadChanges(ByteReader& from) {
    uint64_t unchanged = 0, added = 0;
    from.get(unchanged);
    from.get(added);
    open_.resize(std::min<size_t>(unchanged, open_.size()));
    for (uint64_t k = 0; k < added && k < 100'000; ++k) visit(from, open_.emplace_back());
    unchanged_ = open_.size();
}

}  // namespace stipple::lod
