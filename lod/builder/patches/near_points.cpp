#include "lod/builder/patches/near_points.h"

#include <algorithm>
#include <limits>

#include "engine/base/lanes.h"
#include "engine/base/wide.h"

namespace stipple::lod {
namespace {

constexpr float kFarAway = std::numeric_limits<float>::max();
constexpr size_t kMostLevels = 12, kWaiting = 8 * kMostLevels;
static_assert(kLanes == 8);         // points of a run, children of a node
constexpr size_t kMostRanked = 64;  ///< points within a limit that are put in order at once

/// Keeps the order by (distance, index).
void insert(NearPoints::Found& f, size_t most, float squared, uint32_t index) {
    size_t at = f.count < most ? f.count++ : most - 1;
    for (; at > 0; --at) {
        const float before = f.squared[at - 1];
        if (before < squared || (before == squared && f.index[at - 1] < index)) break;
        f.squared[at] = before;
        f.index[at] = f.index[at - 1];
    }
    f.squared[at] = squared;
    f.index[at] = index;
}

/// Squared distances of points within a limit, in the order of the points.
struct Within {
    alignas(32) float squared[kMostRanked + kLanes];  // NOLINT: set as far as they are read
    alignas(32) uint32_t rank[kMostRanked + kLanes];  // NOLINT
    uint32_t index[kMostRanked + kLanes];             // NOLINT
    uint32_t count = 0;
};

/// How many come before each: those that are nearer, and of equally far ones those that stand before it.
[[gnu::always_inline]] inline void rank(Within& w) {
    floatsAt(&w.squared[w.count], 0).v = Floats{} + kFarAway;
    for (size_t i = 0; i < w.count; i += kLanes) {
        const Floats own = floatsAt(w.squared + i, 0).v;
        Lanes nearer{};
        for (uint32_t k = 0; k < w.count; ++k) nearer -= w.squared[k] < own;
        reinterpret_cast<Anywhere<Lanes>*>(w.rank + i)->v = nearer;
    }
    uint8_t taken[kMostRanked] = {};  // NOLINT
    for (uint32_t i = 0; i < w.count; ++i) w.rank[i] += taken[w.rank[i]]++;
}

/// Only the nearest stay; nothing that is farther than the last of those is looked for any more.
[[gnu::always_inline]] inline void keepNearest(Within& w, size_t most, float& limit) {
    rank(w);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < w.count; ++i) {
        if (w.rank[i] >= most) continue;
        if (w.rank[i] + 1 == most) limit = w.squared[i];
        w.squared[kept] = w.squared[i];
        w.index[kept++] = w.index[i];
    }
    w.count = kept;
}

}  // namespace

NearPoints::NearPoints(const std::vector<glm::dvec3>& points) : count_(points.size()) {
    leaves_.resize((count_ + 7) / 8);
    for (Leaf& leaf : leaves_)
        for (auto& axis : leaf.at) std::fill(std::begin(axis), std::end(axis), kFarAway);
    for (size_t i = 0; i < count_; ++i)
        for (int a = 0; a < 3; ++a) leaves_[i / 8].at[a][i % 8] = static_cast<float>(points[i][a]);
    struct Box {
        std::array<float, 3> lo{kFarAway, kFarAway, kFarAway}, hi{-kFarAway, -kFarAway, -kFarAway};
    };
    std::vector<Box> boxes(leaves_.size());
    for (size_t i = 0; i < count_; ++i)
        for (size_t a = 0; a < 3; ++a) {
            const float v = leaves_[i / 8].at[a][i % 8];
            boxes[i / 8].lo.at(a) = std::min(boxes[i / 8].lo.at(a), v);
            boxes[i / 8].hi.at(a) = std::max(boxes[i / 8].hi.at(a), v);
        }
    do {
        std::vector<Node> level((boxes.size() + 7) / 8);
        std::vector<Box> up(level.size());
        for (size_t k = 0; k < level.size() * 8; ++k)
            for (size_t a = 0; a < 3; ++a) {
                const Box box = k < boxes.size() ? boxes[k] : Box{};
                level[k / 8].lo[a][k % 8] = box.lo.at(a);
                level[k / 8].hi[a][k % 8] = box.hi.at(a);
                up[k / 8].lo.at(a) = std::min(up[k / 8].lo.at(a), box.lo.at(a));
                up[k / 8].hi.at(a) = std::max(up[k / 8].hi.at(a), box.hi.at(a));
            }
        levels_.push_back(std::move(level));
        boxes = std::move(up);
    } while (boxes.size() > 1);
}

STIPPLE_WIDE void NearPoints::search(const NearPoints& tree, const float (&p)[3], size_t most, float limit,
                                     Found& found) {
    struct Waiting {
        float squared;
        uint32_t level, node;  ///< level 0: a leaf
    };
    Waiting stack[kWaiting];  // NOLINT: set as far as it is read
    size_t depth = 0;
    stack[depth++] = {0, static_cast<uint32_t>(tree.levels_.size()), 0};
    float out[kLanes];  // NOLINT
    while (depth > 0) {
        const Waiting here = stack[--depth];
        if (here.squared > limit) continue;
        if (here.level == 0) {
            const Leaf& leaf = tree.leaves_[here.node];
            const Floats x = floatsAt(leaf.at[0], 0).v - p[0], y = floatsAt(leaf.at[1], 0).v - p[1],
                         z = floatsAt(leaf.at[2], 0).v - p[2];
            floatsAt(out, 0).v = x * x + y * y + z * z;
            for (uint32_t k = 0; k < 8; ++k) {
                if (!(out[k] <= limit)) continue;
                if (found.count == most && out[k] == found.squared[most - 1] &&
                    found.index[most - 1] < 8 * here.node + k)
                    continue;
                insert(found, most, out[k], 8 * here.node + k);
                if (found.count == most) limit = found.squared[most - 1];
            }
            continue;
        }
        const Node& node = tree.levels_[here.level - 1][here.node];
        Floats sum{};
        for (int a = 0; a < 3; ++a) {
            const Floats below = floatsAt(node.lo[a], 0).v - p[a], above = p[a] - floatsAt(node.hi[a], 0).v;
            Floats d = below > above ? below : above;
            d = d > 0.0f ? d : Floats{};
            sum += d * d;
        }
        floatsAt(out, 0).v = sum;
        const size_t first = depth;
        for (uint32_t k = 0; k < 8; ++k) {
            if (!(out[k] <= limit)) continue;
            size_t at = depth++;  // the nearest on top
            for (; at > first && stack[at - 1].squared < out[k]; --at) stack[at] = stack[at - 1];
            stack[at] = {out[k], here.level - 1, 8 * here.node + k};
        }
    }
}

STIPPLE_WIDE void NearPoints::searchRuns(const NearPoints& tree, const Box32& box, float limit, Runs& runs) {
    struct Waiting {
        uint32_t level, node;
    };
    Waiting stack[kWaiting];  // NOLINT: set as far as it is read
    size_t depth = 0;
    runs.count = 0;
    runs.isWhole = true;
    stack[depth++] = {static_cast<uint32_t>(tree.levels_.size()), 0};
    float out[kLanes];  // NOLINT
    while (depth > 0) {
        const Waiting here = stack[--depth];
        if (here.level == 0) {
            runs.isWhole = runs.count < Runs::kMostRuns;
            if (!runs.isWhole) return;
            runs.run[runs.count++] = here.node;
            continue;
        }
        const Node& node = tree.levels_[here.level - 1][here.node];
        Floats sum{};
        for (int a = 0; a < 3; ++a) {
            const Floats below = floatsAt(node.lo[a], 0).v - box.hi[a], above = box.lo[a] - floatsAt(node.hi[a], 0).v;
            Floats d = below > above ? below : above;
            d = d > 0.0f ? d : Floats{};
            sum += d * d;
        }
        floatsAt(out, 0).v = sum;
        for (uint32_t k = 8; k-- > 0;)
            if (out[k] <= limit) stack[depth++] = {here.level - 1, 8 * here.node + k};
    }
}

STIPPLE_WIDE void NearPoints::searchAmong(const NearPoints& tree, const Runs& runs, const float (&p)[3], size_t most,
                                          float limit, Found& found) {
    Within w;
    float out[kLanes];  // NOLINT
    for (size_t r = 0; r < runs.count; ++r) {
        const Leaf& leaf = tree.leaves_[runs.run[r]];
        const Floats x = floatsAt(leaf.at[0], 0).v - p[0], y = floatsAt(leaf.at[1], 0).v - p[1],
                     z = floatsAt(leaf.at[2], 0).v - p[2];
        const Floats squared = x * x + y * y + z * z;
        if (!isAny(squared <= limit)) continue;
        floatsAt(out, 0).v = squared;
        if (w.count + kLanes > kMostRanked) keepNearest(w, most, limit);
        for (uint32_t k = 0; k < 8; ++k) {  // (without a branch: what is not within is written over)
            w.squared[w.count] = out[k];
            w.index[w.count] = 8 * runs.run[r] + k;
            w.count += out[k] <= limit ? 1u : 0u;
        }
    }
    rank(w);
    found.count = std::min<size_t>(w.count, most);
    for (uint32_t i = 0; i < w.count; ++i) {
        if (w.rank[i] >= most) continue;
        found.squared[w.rank[i]] = w.squared[i];
        found.index[w.rank[i]] = w.index[i];
    }
}

// (Differences and sums of floats rise with what they are of: no run's box is farther than one of its points, nor from
// a box of places than from one of them.)
void NearPoints::runsNear(const glm::dvec3& lo, const glm::dvec3& hi, float limit, Runs& runs) const {
    runs.count = 0;
    runs.isWhole = false;
    if (count_ == 0) return;
    Box32 box;
    for (int a = 0; a < 3; ++a) {
        box.lo[a] = static_cast<float>(lo[a]);
        box.hi[a] = static_cast<float>(hi[a]);
    }
    searchRuns(*this, box, std::min(limit, kFarAway), runs);
}

void NearPoints::find(const Runs& runs, const glm::dvec3& p, size_t most, float limit, Found& found) const {
    const float at[3] = {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
    if (runs.isWhole)
        searchAmong(*this, runs, at, std::min(most, kMost), std::min(limit, kFarAway), found);
    else
        find(p, most, limit, found);
}

void NearPoints::find(const glm::dvec3& p, size_t most, float limit, Found& found) const {
    found.count = 0;
    if (count_ == 0 || most == 0) return;
    const float at[3] = {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
    search(*this, at, std::min(most, kMost), std::min(limit, kFarAway), found);
}

}  // namespace stipple::lod
