// A bounding volume hierarchy over boxes (median split of the longest axis), for rays.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <numeric>
#include <vector>

namespace stipple {

struct Box {
    glm::dvec3 lo{std::numeric_limits<double>::max()}, hi{std::numeric_limits<double>::lowest()};
    void add(const Box& o) {
        lo = glm::min(lo, o.lo);
        hi = glm::max(hi, o.hi);
    }
    void add(const glm::dvec3& p) { add(Box{p, p}); }
};

class BoxTree {
  public:
    BoxTree() = default;
    explicit BoxTree(const std::vector<Box>& boxes) : items_(boxes.size()) {
        std::iota(items_.begin(), items_.end(), 0u);
        nodes_.push_back({{}, 0, static_cast<uint32_t>(items_.size()), 0});
        for (size_t i = 0; i < nodes_.size(); ++i) {
            Node node = nodes_[i];
            for (uint32_t k = node.begin; k < node.end; ++k) node.box.add(boxes[items_[k]]);
            if (node.end - node.begin > kLeaf) {
                const glm::dvec3 size = node.box.hi - node.box.lo;
                const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
                const uint32_t middle = (node.begin + node.end) / 2;
                std::nth_element(items_.begin() + node.begin, items_.begin() + middle, items_.begin() + node.end,
                                 [&](uint32_t a, uint32_t b) {
                                     return boxes[a].lo[axis] + boxes[a].hi[axis] <
                                            boxes[b].lo[axis] + boxes[b].hi[axis];
                                 });
                node.left = static_cast<uint32_t>(nodes_.size());
                nodes_.push_back({{}, node.begin, middle, 0});
                nodes_.push_back({{}, middle, node.end, 0});
            }
            nodes_[i] = node;
        }
    }

    Box bounds() const { return nodes_.empty() ? Box{} : nodes_[0].box; }

    /// Calls use(item) for every item whose box the ray origin + t direction may meet for nearT <= t <= limit, roughly
    /// front to back; `use` may lower limit.
    template <typename Use>
    void visit(const glm::dvec3& origin, const glm::dvec3& direction, double nearT, const double& limit,
               const Use& use) const {
        if (nodes_.empty()) return;
        glm::dvec3 inverse;
        for (int a = 0; a < 3; ++a) inverse[a] = direction[a] == 0 ? 1e300 : 1 / direction[a];
        std::array<uint32_t, 64> stack{};
        size_t depth = 0;
        stack[depth++] = 0;
        while (depth > 0) {
            const Node& node = nodes_[stack[--depth]];
            const glm::dvec3 a = (node.box.lo - origin) * inverse, b = (node.box.hi - origin) * inverse;
            const glm::dvec3 lo = glm::min(a, b), hi = glm::max(a, b);
            const double enter = std::max({lo.x, lo.y, lo.z, nearT}), leave = std::min({hi.x, hi.y, hi.z, limit});
            if (!(enter <= leave * (1 + 1e-12) + 1e-300)) continue;
            if (node.left != 0) {
                // Nearer child last, so that it is taken first.
                const bool leftFirst = glm::dot(nodes_[node.left].box.lo + nodes_[node.left].box.hi -
                                                    nodes_[node.left + 1].box.lo - nodes_[node.left + 1].box.hi,
                                                direction) < 0;
                stack[depth++] = leftFirst ? node.left + 1 : node.left;
                stack[depth++] = leftFirst ? node.left : node.left + 1;
                continue;
            }
            for (uint32_t i = node.begin; i < node.end; ++i) use(items_[i]);
        }
    }

  private:
    static constexpr uint32_t kLeaf = 4;
    struct Node {
        Box box;
        uint32_t begin = 0, end = 0, left = 0;  ///< left != 0: children left, left + 1
    };
    std::vector<uint32_t> items_;
    std::vector<Node> nodes_;
};

}  // namespace stipple
