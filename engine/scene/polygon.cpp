// Ears are cut one after the other (Meisters 1975). Only a corner that bends inwards can lie in an ear; a grid finds
// those near it, so that the time is about linear where ears are small.
#include "engine/scene/polygon.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stipple::scene {
namespace {

double cross(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Along its normal (Newell), turning left.
std::vector<glm::dvec2> flattened(const std::vector<glm::dvec3>& corners) {
    glm::dvec3 normal(0);
    for (size_t i = 0; i < corners.size(); ++i) {
        const glm::dvec3 &a = corners[i], &b = corners[(i + 1) % corners.size()];
        normal += glm::cross(a - corners[0], b - corners[0]);
    }
    const glm::dvec3 size = glm::abs(normal);
    const int drop = size.x > size.y && size.x > size.z ? 0 : size.y > size.z ? 1 : 2;
    const int u = (drop + 1) % 3, v = (drop + 2) % 3;
    std::vector<glm::dvec2> flat;
    flat.reserve(corners.size());
    for (const glm::dvec3& p : corners) flat.emplace_back(normal[drop] < 0 ? -p[u] : p[u], p[v]);
    return flat;
}

class Ears {
  public:
    explicit Ears(std::vector<glm::dvec2> at) : at_(std::move(at)), count_(static_cast<uint32_t>(at_.size())) {
        previous_.resize(count_);
        next_.resize(count_);
        isInward_.resize(count_);
        for (uint32_t i = 0; i < count_; ++i) {
            previous_[i] = (i + count_ - 1) % count_;
            next_[i] = (i + 1) % count_;
        }
        makeGrid();
    }

    std::vector<std::array<uint32_t, 3>> cut() {
        std::vector<std::array<uint32_t, 3>> triangles;
        std::vector<uint32_t> toTry, changed;
        std::vector<uint8_t> isGone(count_), isChanged(count_);
        for (uint32_t i = 0; i < count_; ++i) toTry.push_back(i);
        const auto cutOff = [&](uint32_t corner) {
            const uint32_t before = previous_[corner], after = next_[corner];
            triangles.push_back({before, corner, after});
            next_[before] = after;
            previous_[after] = before;
            isGone[corner] = 1;
            isInward_[corner] = 0;
            for (const uint32_t i : {before, after}) {
                isInward_[i] = isInward_[i] != 0 && bendsInwards(i) ? 1 : 0;
                if (std::exchange(isChanged[i], uint8_t{1}) == 0) changed.push_back(i);
            }
        };
        bool isTurned = false;
        const auto isOver = [&] { return triangles.size() + 2 >= count_; };
        while (!isOver()) {
            // Round by round, so that ears stay small: what changed is tried again in the next one, and all that is
            // left when nothing did.
            const size_t before = triangles.size();
            for (const uint32_t corner : toTry)
                if (!isOver() && isGone[corner] == 0 && isChanged[corner] == 0 && isEar(corner)) cutOff(corner);
            toTry = std::exchange(changed, {});
            if (isTurned = !isTurned; isTurned) std::reverse(toTry.begin(), toTry.end());  // strips zigzag, no fans
            for (const uint32_t i : toTry) isChanged[i] = 0;
            if (!toTry.empty() && triangles.size() > before) continue;
            const bool wasAll = isTryingAll_;
            toTry.clear();
            for (uint32_t i = 0; i < count_; ++i)
                if (isGone[i] == 0) toTry.push_back(i);
            isTryingAll_ = triangles.size() == before;
            if (wasAll && isTryingAll_) cutOff(toTry.front());  // it crosses itself: any is taken
        }
        return triangles;
    }

  private:
    bool bendsInwards(uint32_t i) const { return cross(at_[previous_[i]], at_[i], at_[next_[i]]) <= 0; }

    bool isEar(uint32_t corner) const {
        const glm::dvec2 &a = at_[previous_[corner]], &b = at_[corner], &c = at_[next_[corner]];
        if (cross(a, b, c) <= 0) return false;
        const glm::uvec2 lo = cellOf(glm::min(glm::min(a, b), c)), hi = cellOf(glm::max(glm::max(a, b), c));
        for (uint32_t y = lo.y; y <= hi.y; ++y)
            for (uint32_t x = lo.x; x <= hi.x; ++x) {
                const uint32_t cell = y * edge_ + x;
                for (uint32_t k = firstIn_[cell]; k < firstIn_[cell + 1]; ++k) {
                    const glm::dvec2& p = at_[sorted_[k]];
                    if (isInward_[sorted_[k]] == 0 || p == a || p == b || p == c) continue;
                    if (cross(a, b, p) >= 0 && cross(b, c, p) >= 0 && cross(c, a, p) >= 0) return false;
                }
            }
        return true;
    }

    glm::uvec2 cellOf(const glm::dvec2& p) const {
        return glm::uvec2(glm::clamp((p - low_) * cellsPerUnit_, glm::dvec2(0), glm::dvec2(edge_ - 1)));
    }
    /// Of the corners that bend inwards; others never will.
    void makeGrid() {
        std::vector<uint32_t> inward;
        glm::dvec2 high(-1e300);
        for (uint32_t i = 0; i < count_; ++i) {
            low_ = glm::min(low_, at_[i]);
            high = glm::max(high, at_[i]);
            isInward_[i] = bendsInwards(i) ? 1 : 0;
            if (isInward_[i] != 0) inward.push_back(i);
        }
        edge_ = std::clamp(static_cast<uint32_t>(std::sqrt(static_cast<double>(inward.size()))), 1u, 2048u);
        cellsPerUnit_ = static_cast<double>(edge_) / glm::max(high - low_, glm::dvec2(1e-300));
        firstIn_.assign(size_t{edge_} * edge_ + 1, 0);
        const auto cell = [&](uint32_t i) { return cellOf(at_[i]).y * edge_ + cellOf(at_[i]).x; };
        for (const uint32_t i : inward) ++firstIn_[cell(i) + 1];
        for (size_t k = 1; k < firstIn_.size(); ++k) firstIn_[k] += firstIn_[k - 1];
        std::vector<uint32_t> to(firstIn_.begin(), firstIn_.end() - 1);
        sorted_.resize(inward.size());
        for (const uint32_t i : inward) sorted_[to[cell(i)]++] = i;
    }

    std::vector<glm::dvec2> at_;
    uint32_t count_ = 0, edge_ = 1;
    bool isTryingAll_ = false;
    glm::dvec2 low_{1e300}, cellsPerUnit_{1};
    std::vector<uint32_t> previous_, next_, firstIn_, sorted_;
    std::vector<uint8_t> isInward_;
};

}  // namespace

std::vector<std::array<uint32_t, 3>> triangulatePolygon(const std::vector<glm::dvec3>& corners) {
    if (corners.size() < 3) return {};
    return Ears(flattened(corners)).cut();
}

}  // namespace stipple::scene
