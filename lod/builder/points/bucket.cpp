#include "lod/builder/points/bucket.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "engine/base/huge_buffer.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

std::array<int64_t, 3> cornerOf(const Frame& frame, Key key) {
    const uint32_t drop = frame.rootLog2 - frame.keyLevels;
    const auto along = [&](int a) { return static_cast<int64_t>(compactBits(key >> a) << drop); };
    return {along(0), along(1), along(2)};
}
Key keyAt(const Frame& frame, const std::array<int64_t, 3>& p) {
    return frame.keyOf(static_cast<uint64_t>(p[0]), static_cast<uint64_t>(p[1]), static_cast<uint64_t>(p[2]));
}

/// The cell that holds a lattice position, if it is inside the root.
uint32_t cellAt(const Frame& frame, const CellTree& tree, const std::array<int64_t, 3>& p) {
    const int64_t size = int64_t{1} << frame.rootLog2;
    for (const int64_t v : p)
        if (v < 0 || v >= size) return CellTree::kNone;
    return tree.cellOf(keyAt(frame, p));
}

}  // namespace

BucketPlan planBuckets(const Frame& frame, const CellTree& tree, uint64_t most) {
    BucketPlan plan;
    const std::vector<Cell>& cells = tree.cells();
    plan.ofCell.resize(cells.size());
    uint64_t points = 0;
    for (const Subtree& subtree : tree.subtrees()) {
        if (plan.buckets.empty() || plan.buckets.back().points + subtree.count > most) {
            plan.buckets.emplace_back();
            plan.buckets.back().firstPoint = points;
            plan.buckets.back().firstCell = subtree.firstCell;
        }
        BucketPlan::Bucket& bucket = plan.buckets.back();
        bucket.subtrees.push_back(subtree);
        bucket.points += subtree.count;
        points += subtree.count;
        bucket.cells += subtree.cells;
        for (uint32_t c = 0; c < subtree.cells; ++c)
            plan.ofCell[subtree.firstCell + c] = static_cast<uint32_t>(plan.buckets.size() - 1);
    }
    // Beside which cells does another bucket begin, and how small are its cells?
    plan.border.assign(cells.size(), 0);
    for (size_t i = 0; i < cells.size(); ++i) {
        const auto corner = cornerOf(frame, cells[i].key);
        const auto edge = static_cast<int64_t>(frame.cellSize(cells[i].level)), root = int64_t{1} << frame.rootLog2;
        const uint32_t shift = frame.shiftOf(cells[i].level);
        for (int64_t k = 0; k < 27; ++k) {
            const std::array<int64_t, 3> p{corner[0] + (k % 3 - 1) * edge, corner[1] + (k / 3 % 3 - 1) * edge,
                                           corner[2] + (k / 9 - 1) * edge};
            if (std::any_of(p.begin(), p.end(), [&](int64_t v) { return v < 0 || v >= root; })) continue;
            const Key key = keyAt(frame, p);
            const auto first = std::partition_point(cells.begin(), cells.end(),
                                                    [&](const Cell& c) { return c.key >> shift < key >> shift; });
            const auto end =
                std::partition_point(first, cells.end(), [&](const Cell& c) { return c.key >> shift == key >> shift; });
            const auto look = [&](size_t other) {
                if (plan.ofCell[other] == plan.ofCell[i]) return;
                const uint8_t level = std::max(cells[other].level, cells[i].level);
                plan.border[i] = std::max(plan.border[i], static_cast<uint8_t>(level + 1));
            };
            if (first == end) {
                if (const uint32_t larger = tree.cellOf(key); larger != CellTree::kNone) look(larger);
                continue;
            }
            // (Buckets are runs of cells: of the first and the last of them, so are those between.)
            const auto from = static_cast<size_t>(first - cells.begin()), to = static_cast<size_t>(end - cells.begin());
            if (plan.ofCell[from] == plan.ofCell[i] && plan.ofCell[to - 1] == plan.ofCell[i]) continue;
            for (size_t other = from; other < to; ++other) look(other);
        }
    }
    return plan;
}

// ---- records ----

RecordLayout::RecordLayout(bool hasColour, bool hasNormal, bool hasRadius, const std::vector<AttributeInfo>& attributes)
    : hasWord_(hasColour || hasNormal),
      hasNormal_(hasNormal),
      hasRadius_(hasRadius),
      restBytes_((hasWord_ ? 4u : 0u) + (hasNormal ? 4u : 0u) + (hasRadius ? 4u : 0u)) {
    for (const AttributeInfo& a : attributes) {
        widths_.push_back(bytesOf(a.type));
        restBytes_ += widths_.back();
    }
}

void RecordLayout::resize(Points& points, size_t count) const {
    for (auto* column : {&points.x, &points.y, &points.z, &points.normal}) resizeHuge(*column, count);
    resizeHuge(points.colour, count);
    resizeHuge(points.radius, count);
    points.high.resize(isWide() ? count : 0);
    points.attributes.resize(widths_.size());
    for (size_t a = 0; a < widths_.size(); ++a) points.attributes[a].resize(count * widths_[a]);
}

// ---- where they lie ----

BucketBytes::BucketBytes(const std::string& folder, size_t index)
    : points(folder.empty() ? "" : fmt::format("{}/points-{}", folder, index)),
      ghosts(folder.empty() ? "" : fmt::format("{}/ghosts-{}", folder, index)) {}

Buckets makeBuckets(size_t count, const std::string& folder) {
    Buckets buckets;
    for (size_t i = 0; i < count; ++i) buckets.push_back(std::make_unique<BucketBytes>(folder, i));
    return buckets;
}

// ---- the way there ----

Distributor::Distributor(const Frame& frame, const CellTree& tree, const BucketPlan& plan, const RecordLayout& layout,
                         Buckets& buckets, int workers, uint64_t bufferBytes, bool wantGhosts)
    : frame_(frame), tree_(tree), plan_(plan), layout_(layout), buckets_(buckets), wantGhosts_(wantGhosts) {
    const size_t slots = 2 * plan.buckets.size();
    bufferBytes_ = std::clamp<size_t>(bufferBytes / (static_cast<size_t>(workers) * slots), 4096, 1 << 18);
    buffers_.assign(static_cast<size_t>(workers), std::vector<Buffer>(slots));
    std::array<bool, kPlaceBits + 1> has{};
    for (const Cell& c : tree.cells()) has.at(c.level) = true;
    for (uint32_t level = 0; level < has.size(); ++level)
        if (has.at(level)) levels_.push_back(level);
}

template <typename Write>
Result<void> Distributor::put(int worker, uint32_t bucket, size_t kind, size_t count, const Write& write) {
    const size_t slot = 2 * bucket + kind;
    Buffer& buffer = buffers_[static_cast<size_t>(worker)][slot];
    if (buffer.bytes.empty()) buffer.bytes.resize(std::max(bufferBytes_, count));
    write(buffer.bytes.data() + buffer.used);
    buffer.used += count;
    if (buffer.used + count <= buffer.bytes.size()) return {};
    return send(slot, buffer);
}

Result<void> Distributor::send(size_t slot, Buffer& buffer) {
    BucketBytes& bucket = *buckets_[slot / 2];
    const size_t bytes = std::exchange(buffer.used, 0);
    return (slot % 2 == kPoints ? bucket.points : bucket.ghosts).append(std::span(buffer.bytes).first(bytes));
}

Result<void> Distributor::flush() {
    for (auto& worker : buffers_)
        for (size_t slot = 0; slot < worker.size(); ++slot) {
            if (worker[slot].used > 0) STIPPLE_TRY(send(slot, worker[slot]));
            worker[slot] = {};
        }
    return {};
}

Result<void> Distributor::add(int worker, const Points& block) {
    std::vector<uint32_t> seenFrom, cells(block.size());
    std::vector<uint64_t> keys(block.size());
    forEachKey(frame_, block.coordinates(), [&](size_t i, auto key) {
        cells[i] = tree_.cellOf(key);
        keys[i] = static_cast<uint64_t>(key);
    });
    for (size_t i = 0; i < block.size(); ++i) {
        const Place place = block.place(i);
        const uint32_t cell = cells[i];
        if (cell == CellTree::kNone)  // where nothing was when it was counted
            return fail(ErrorKind::input, "changed while it was read", "", "build again when it is complete");
        STIPPLE_TRY(put(worker, plan_.ofCell[cell], kPoints, layout_.bytes(),
                        [&](uint8_t* to) { layout_.write(block, i, keys[i], to); }));
        if (!wantGhosts_ || plan_.border[cell] == 0) continue;
        ghosts(cell, place, seenFrom);
        for (const uint32_t bucket : seenFrom)
            STIPPLE_TRY(put(worker, bucket, kGhosts, layout_.ghostBytes(),
                            [&](uint8_t* to) { layout_.writePlace(place, keys[i], to); }));
    }
    return {};
}

/// Other buckets whose cells see a point of `cell`.
void Distributor::ghosts(uint32_t cell, const Place& place, std::vector<uint32_t>& to) const {
    to.clear();
    const uint32_t own = tree_.cells()[cell].level;
    for (const uint32_t level : levels_) {
        if (level < own) continue;
        if (level >= plan_.border[cell]) return;
        // A cell of this size (or, at the point's own, a larger one) within a quarter of it holds one of these places.
        const int64_t size = int64_t{1} << (frame_.rootLog2 - level), reach = size / 4,
                      ownSize = int64_t{1} << (frame_.rootLog2 - own);
        const std::array<int64_t, 3> p{static_cast<int64_t>(place[0]), static_cast<int64_t>(place[1]),
                                       static_cast<int64_t>(place[2])};
        // Along each axis itself, and the places a step away that lie out of a cell of this size.
        std::array<std::array<int64_t, 3>, 3> places{};
        std::array<size_t, 3> counts{};
        bool isNear = false;
        for (size_t a = 0; a < 3; ++a) {
            const int64_t local = p[a] & (size - 1), inOwn = p[a] & (ownSize - 1);
            const auto add = [&](int64_t by) { places[a][counts[a]++] = p[a] + by; };
            if (local < reach) add(-reach);
            add(0);
            if (local + reach >= size) add(reach);
            isNear = isNear || inOwn < reach || inOwn + reach >= ownSize;
        }
        if (!isNear) return;  // nor is it within less
        for (size_t k = 0; k < counts[0] * counts[1] * counts[2]; ++k) {
            const std::array<int64_t, 3> q{places[0][k % counts[0]], places[1][k / counts[0] % counts[1]],
                                           places[2][k / (counts[0] * counts[1])]};
            if (isSame(q, p)) continue;
            const uint32_t other = cellAt(frame_, tree_, q);
            if (other == CellTree::kNone) continue;
            const uint32_t otherLevel = tree_.cells()[other].level, bucket = plan_.ofCell[other];
            if (level == own ? otherLevel > own : otherLevel != level) continue;
            if (bucket != plan_.ofCell[cell] && std::find(to.begin(), to.end(), bucket) == to.end())
                to.push_back(bucket);
        }
    }
}

}  // namespace stipple::lod
