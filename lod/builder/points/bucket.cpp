#include "lod/builder/points/bucket.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

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
    // Beside which cells does another bucket begin? Buckets are runs of cells, so the first and the last cell of a
    // neighbouring place of the same size tell.
    plan.isBorder.assign(cells.size(), 0);
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
            const auto isOther = [&](size_t other) { return plan.ofCell[other] != plan.ofCell[i]; };
            if (first != end) {
                if (isOther(static_cast<size_t>(first - cells.begin())) ||
                    isOther(static_cast<size_t>(end - cells.begin()) - 1))
                    plan.isBorder[i] = 1;
            } else if (const uint32_t larger = tree.cellOf(key); larger != CellTree::kNone && isOther(larger)) {
                plan.isBorder[i] = 1;
            }
        }
    }
    return plan;
}

// ---- records ----

RecordLayout::RecordLayout(bool hasColour, bool hasNormal, bool hasRadius, const std::vector<AttributeInfo>& attributes)
    : hasWord_(hasColour || hasNormal),
      hasNormal_(hasNormal),
      hasRadius_(hasRadius),
      bytes_(12 + (hasWord_ ? 4u : 0u) + (hasNormal ? 4u : 0u) + (hasRadius ? 4u : 0u)) {
    for (const AttributeInfo& a : attributes) {
        widths_.push_back(bytesOf(a.type));
        bytes_ += widths_.back();
    }
}

void RecordLayout::write(const Points& from, size_t i, uint8_t* to) const {
    const std::array<uint32_t, 3> first{from.x[i], from.y[i], from.z[i]};
    std::memcpy(to, first.data(), 12);
    to += 12;
    if (isWide_) {
        const uint64_t high = from.high.empty() ? 0 : from.high[i];
        std::memcpy(to, &high, 8);
        to += 8;
    }
    if (hasWord_) {
        std::memcpy(to, &from.colour[i], 4);
        to += 4;
    }
    if (hasNormal_) {
        std::memcpy(to, &from.normal[i], 4);
        to += 4;
    }
    if (hasRadius_) {
        std::memcpy(to, &from.radius[i], 4);
        to += 4;
    }
    for (size_t a = 0; a < widths_.size(); ++a) {
        std::memcpy(to, from.attributes[a].data() + i * widths_[a], widths_[a]);
        to += widths_[a];
    }
}

void RecordLayout::readPlace(const uint8_t*& from, size_t i, Points& to) const {
    std::array<uint32_t, 3> first{};
    std::memcpy(first.data(), from, 12);
    to.x[i] = first[0];
    to.y[i] = first[1];
    to.z[i] = first[2];
    from += 12;
    if (!isWide_) return;
    std::memcpy(&to.high[i], from, 8);
    from += 8;
}

void RecordLayout::readGhosts(const uint8_t* from, size_t count, Points& to) const {
    for (auto* column : {&to.x, &to.y, &to.z}) column->resize(count);
    to.high.resize(isWide_ ? count : 0);
    for (size_t i = 0; i < count; ++i) readPlace(from, i, to);
}

void RecordLayout::read(const uint8_t* from, size_t count, Points& to) const {
    const size_t before = to.size();
    to.high.resize(isWide_ ? before + count : 0);
    for (auto* column : {&to.x, &to.y, &to.z, &to.colour, &to.normal}) column->resize(before + count);
    to.radius.resize(before + count);
    to.attributes.resize(widths_.size());
    for (size_t a = 0; a < widths_.size(); ++a) to.attributes[a].resize((before + count) * widths_[a]);
    for (size_t i = before; i < before + count; ++i) {
        readPlace(from, i, to);
        to.colour[i] = kPlainColour | shared::kFlagNoNormal << 24;
        if (hasWord_) {
            std::memcpy(&to.colour[i], from, 4);
            from += 4;
        }
        if (hasNormal_) {
            std::memcpy(&to.normal[i], from, 4);
            from += 4;
        }
        if (hasRadius_) {
            std::memcpy(&to.radius[i], from, 4);
            from += 4;
        }
        for (size_t a = 0; a < widths_.size(); ++a) {
            std::memcpy(to.attributes[a].data() + i * widths_[a], from, widths_[a]);
            from += widths_[a];
        }
    }
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
    buffers_.assign(static_cast<size_t>(workers), std::vector<std::vector<uint8_t>>(slots));
    std::array<bool, kPlaceBits + 1> has{};
    for (const Cell& c : tree.cells()) has.at(c.level) = true;
    for (uint32_t level = 0; level < has.size(); ++level)
        if (has.at(level)) levels_.push_back(level);
}

Result<void> Distributor::put(int worker, uint32_t bucket, int kind, const uint8_t* bytes, size_t count) {
    std::vector<uint8_t>& buffer = buffers_[static_cast<size_t>(worker)][2 * bucket + static_cast<size_t>(kind)];
    if (buffer.capacity() == 0) buffer.reserve(bufferBytes_);
    const size_t at = buffer.size();
    buffer.resize(at + count);
    std::memcpy(buffer.data() + at, bytes, count);
    if (at + 2 * count <= bufferBytes_) return {};
    STIPPLE_TRY((kind == 0 ? buckets_[bucket]->points : buckets_[bucket]->ghosts).append(buffer));
    buffer.clear();
    return {};
}

Result<void> Distributor::flush() {
    for (auto& worker : buffers_)
        for (size_t slot = 0; slot < worker.size(); ++slot) {
            if (!worker[slot].empty()) {
                BucketBytes& bucket = *buckets_[slot / 2];
                STIPPLE_TRY((slot % 2 == 0 ? bucket.points : bucket.ghosts).append(worker[slot]));
            }
            worker[slot] = {};
        }
    return {};
}

Result<void> Distributor::add(int worker, const Points& block) {
    std::vector<uint8_t> record(layout_.bytes());
    std::vector<uint32_t> seenFrom;
    for (size_t i = 0; i < block.size(); ++i) {
        const Place place = block.place(i);
        const uint32_t cell = tree_.cellOf(frame_.keyOf(place));
        layout_.write(block, i, record.data());
        STIPPLE_TRY(put(worker, plan_.ofCell[cell], 0, record.data(), record.size()));
        if (!wantGhosts_ || plan_.isBorder[cell] == 0) continue;
        ghosts(cell, place, seenFrom);
        for (const uint32_t bucket : seenFrom) STIPPLE_TRY(put(worker, bucket, 1, record.data(), layout_.ghostBytes()));
    }
    return {};
}

/// Other buckets whose cells see a point of `cell`.
void Distributor::ghosts(uint32_t cell, const Place& place, std::vector<uint32_t>& to) const {
    to.clear();
    const uint32_t own = tree_.cells()[cell].level;
    for (const uint32_t level : levels_) {
        if (level < own) continue;
        // A cell of this size (or, at the point's own, a larger one) within a quarter of it holds one of these places.
        const int64_t size = int64_t{1} << (frame_.rootLog2 - level), reach = size / 4,
                      ownSize = int64_t{1} << (frame_.rootLog2 - own);
        const std::array<int64_t, 3> p{static_cast<int64_t>(place[0]), static_cast<int64_t>(place[1]),
                                       static_cast<int64_t>(place[2])};
        std::array<std::array<bool, 3>, 3>
            leaves{};  // per axis: does -reach, 0, +reach lead out of a cell of this size?
        bool isNear = false;
        for (size_t a = 0; a < 3; ++a) {
            const int64_t local = p[a] & (size - 1), inOwn = p[a] & (ownSize - 1);
            leaves[a] = {local < reach, true, local + reach >= size};
            isNear = isNear || inOwn < reach || inOwn + reach >= ownSize;
        }
        if (!isNear) return;  // nor is it within less
        for (size_t k = 0; k < 27; ++k) {
            const std::array<size_t, 3> step{k % 3, k / 3 % 3, k / 9};
            if (k == 13 || !leaves[0][step[0]] || !leaves[1][step[1]] || !leaves[2][step[2]]) continue;
            std::array<int64_t, 3> q{};
            for (size_t a = 0; a < 3; ++a) q[a] = p[a] + (static_cast<int64_t>(step[a]) - 1) * reach;
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
