// A tree of boxes over items that lie in Morton order: leaves are runs of them, every inner node has eight children or
// fewer. Nothing is sorted or moved, so what it says hangs on the items alone. For nearest points and triangles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <vector>

#include "engine/base/executor.h"

namespace stipple::lod {

struct RunBox {
    glm::dvec3 lo{std::numeric_limits<double>::max()}, hi{std::numeric_limits<double>::lowest()};
    void add(const RunBox& o) {
        lo = glm::min(lo, o.lo);
        hi = glm::max(hi, o.hi);
    }
    void add(const glm::dvec3& p) { add(RunBox{p, p}); }
    double squaredDistance(const glm::dvec3& p) const {
        const glm::dvec3 d = glm::max(glm::max(lo - p, p - hi), glm::dvec3(0));
        return glm::dot(d, d);
    }
};

class RunTree {
  public:
    static constexpr size_t kRun = 8, kFan = 8;
    RunTree() = default;
    /// `boxOf(item)`: of items [0, count).
    template <typename BoxOf>
    RunTree(size_t count, const BoxOf& boxOf, Executor& executor) : count_(count) {
        levels_.emplace_back((count + kRun - 1) / kRun);
        executor.parallelFor(levels_[0].size(), 256, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k)
                for (size_t i = k * kRun; i < std::min((k + 1) * kRun, count); ++i) levels_[0][k].add(boxOf(i));
        });
        while (levels_.back().size() > 1) {
            const std::vector<RunBox>& below = levels_.back();
            std::vector<RunBox> up((below.size() + kFan - 1) / kFan);
            for (size_t k = 0; k < below.size(); ++k) up[k / kFan].add(below[k]);
            levels_.push_back(std::move(up));
        }
    }
    size_t size() const { return count_; }

    /// Calls use(item) for items whose runs' boxes are within sqrt(squaredLimit), nearer ones roughly first; `use` may
    /// lower squaredLimit. Equally far ones are always called in the same order.
    template <typename Use>
    void visit(const glm::dvec3& p, const double& squaredLimit, const Use& use) const {
        if (count_ == 0) return;
        descend(levels_.size() - 1, 0, p, squaredLimit, use);
    }

  private:
    template <typename Use>
    void descend(size_t level, size_t node, const glm::dvec3& p, const double& limit, const Use& use) const {
        if (level == 0) {
            for (size_t i = node * kRun; i < std::min((node + 1) * kRun, count_); ++i) use(i);
            return;
        }
        const std::vector<RunBox>& below = levels_[level - 1];
        const size_t first = node * kFan, last = std::min(first + kFan, below.size());
        struct Child {
            double squared;
            size_t node;
        };
        Child children[kFan];  // NOLINT: set as far as it is read
        size_t n = 0;
        for (size_t k = first; k < last; ++k) {
            const double squared = below[k].squaredDistance(p);
            if (squared > limit) continue;
            size_t at = n++;
            for (; at > 0 && children[at - 1].squared > squared; --at) children[at] = children[at - 1];
            children[at] = {squared, k};
        }
        for (size_t k = 0; k < n && children[k].squared <= limit; ++k)
            descend(level - 1, children[k].node, p, limit, use);
    }

    size_t count_ = 0;
    std::vector<std::vector<RunBox>> levels_;  ///< leaves first
};

}  // namespace stipple::lod
