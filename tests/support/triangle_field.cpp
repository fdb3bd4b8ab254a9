#include "tests/support/triangle_field.h"

#include <algorithm>
#include <limits>

namespace stipple::test {

using glm::dvec3;

TriangleField::TriangleField(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
    if (triangles_.empty()) return;
    nodes_.push_back({{}, {}, 0, static_cast<uint32_t>(triangles_.size()), 0});
    for (uint32_t i = 0; i < nodes_.size(); ++i) split(i);
}

void TriangleField::split(uint32_t index) {
    Node node = nodes_[index];
    node.lo = dvec3(std::numeric_limits<double>::max());
    node.hi = -node.lo;
    for (uint32_t k = node.begin; k < node.end; ++k)
        for (const dvec3& corner : triangles_[k]) {
            node.lo = glm::min(node.lo, corner);
            node.hi = glm::max(node.hi, corner);
        }
    if (node.end - node.begin > 4) {
        const dvec3 size = node.hi - node.lo;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const uint32_t middle = (node.begin + node.end) / 2;
        const auto sum = [axis](const Triangle& t) { return t[0][axis] + t[1][axis] + t[2][axis]; };
        std::nth_element(triangles_.begin() + node.begin, triangles_.begin() + middle, triangles_.begin() + node.end,
                         [&](const Triangle& a, const Triangle& b) { return sum(a) < sum(b); });
        node.left = static_cast<uint32_t>(nodes_.size());
        nodes_.push_back({{}, {}, node.begin, middle, 0});
        nodes_.push_back({{}, {}, middle, node.end, 0});
    }
    nodes_[index] = node;
}

double TriangleField::distance(const dvec3& place, double limit) const {
    if (nodes_.empty()) return limit;
    const auto away = [&](uint32_t i) {
        return glm::length(glm::max(dvec3(0), glm::max(nodes_[i].lo - place, place - nodes_[i].hi)));
    };
    std::vector<uint32_t> open{0};
    while (!open.empty()) {
        const uint32_t i = open.back();
        open.pop_back();
        if (away(i) >= limit) continue;
        const Node& node = nodes_[i];
        if (node.left == 0) {
            for (uint32_t k = node.begin; k < node.end; ++k)
                limit = std::min(limit, glm::length(place - closestPlace(triangles_[k], place)));
            continue;
        }
        const bool isFirst = away(node.left) <= away(node.left + 1);
        open.push_back(isFirst ? node.left + 1 : node.left);
        open.push_back(isFirst ? node.left : node.left + 1);
    }
    return limit;
}

}  // namespace stipple::test
