// How far a place is from the nearest of many things, in fp64: a tree of boxes around them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace stipple::study {

/// `Of`: what things are: `Item`; `grow(item, lo, hi)`: a box around it, too; `along(item, axis)`: where it is, by any
/// measure; `distance(item, place)`.
template <typename Of>
class NearestField {
  public:
    using Item = typename Of::Item;
    explicit NearestField(std::vector<Item> items) : items_(std::move(items)) {
        if (items_.empty()) return;
        nodes_.push_back({{}, {}, 0, static_cast<uint32_t>(items_.size()), 0});
        for (uint32_t i = 0; i < nodes_.size(); ++i) split(i);
    }
    /// World units; `limit` where none is nearer.
    double distance(const glm::dvec3& place, double limit) const {
        if (nodes_.empty()) return limit;
        const auto away = [&](uint32_t i) {
            return glm::length(glm::max(glm::dvec3(0), glm::max(nodes_[i].lo - place, place - nodes_[i].hi)));
        };
        std::vector<uint32_t> open{0};
        while (!open.empty()) {
            const uint32_t i = open.back();
            open.pop_back();
            if (away(i) >= limit) continue;
            const Node& node = nodes_[i];
            if (node.left == 0) {
                for (uint32_t k = node.begin; k < node.end; ++k)
                    limit = std::min(limit, Of::distance(items_[k], place));
                continue;
            }
            const bool isFirst = away(node.left) <= away(node.left + 1);
            open.push_back(isFirst ? node.left + 1 : node.left);
            open.push_back(isFirst ? node.left : node.left + 1);
        }
        return limit;
    }

  private:
    struct Node {
        glm::dvec3 lo{0}, hi{0};
        uint32_t begin = 0, end = 0, left = 0;  ///< left: 0 at leaves; the other child follows it
    };
    void split(uint32_t index) {
        constexpr uint32_t kMost = 8;
        Node node = nodes_[index];
        node.lo = glm::dvec3(std::numeric_limits<double>::max());
        node.hi = -node.lo;
        for (uint32_t k = node.begin; k < node.end; ++k) Of::grow(items_[k], node.lo, node.hi);
        if (node.end - node.begin > kMost) {
            const glm::dvec3 size = node.hi - node.lo;
            const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
            const uint32_t middle = (node.begin + node.end) / 2;
            std::nth_element(items_.begin() + node.begin, items_.begin() + middle, items_.begin() + node.end,
                             [&](const Item& a, const Item& b) { return Of::along(a, axis) < Of::along(b, axis); });
            node.left = static_cast<uint32_t>(nodes_.size());
            nodes_.push_back({{}, {}, node.begin, middle, 0});
            nodes_.push_back({{}, {}, middle, node.end, 0});
        }
        nodes_[index] = node;
    }

    std::vector<Item> items_;
    std::vector<Node> nodes_;
};

}  // namespace stipple::study
