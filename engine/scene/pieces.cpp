#include "engine/scene/pieces.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace stipple::scene {
namespace {

/// The root of a vertex, with shorter ways there for the next who asks.
uint32_t rootOf(std::vector<uint32_t>& parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

/// Each vertex's first of the same place.
std::vector<uint32_t> joinedByPlace(const Primitive& p) {
    std::vector<uint32_t> order(p.position.size()), parent(p.position.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](uint32_t i) {
        const glm::dvec3 at = p.at(i);
        return std::tuple(at.x, at.y, at.z, i);
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
    for (size_t k = 0; k < order.size(); ++k)
        parent[order[k]] = k > 0 && p.at(order[k]) == p.at(order[k - 1]) ? parent[order[k - 1]] : order[k];
    return parent;
}

}  // namespace

Pieces piecesOf(const Primitive& p) {
    std::vector<uint32_t> parent = joinedByPlace(p);
    const size_t triangles = p.indices.size() / 3;
    for (size_t t = 0; t < triangles; ++t)
        for (size_t k = 1; k < 3; ++k) {
            const uint32_t a = rootOf(parent, p.indices[3 * t]), b = rootOf(parent, p.indices[3 * t + k]);
            parent[std::max(a, b)] = std::min(a, b);
        }
    Pieces pieces;
    std::vector<uint32_t> number(parent.size(), ~0u);
    for (size_t t = 0; t < triangles; ++t) {
        uint32_t& n = number[rootOf(parent, p.indices[3 * t])];
        if (n == ~0u) {
            n = static_cast<uint32_t>(pieces.area.size());
            pieces.area.push_back(0);
        }
        pieces.of.push_back(n);
        const glm::dvec3 a = p.at(p.indices[3 * t]);
        const double area =
            0.5 * glm::length(glm::cross(p.at(p.indices[3 * t + 1]) - a, p.at(p.indices[3 * t + 2]) - a));
        if (std::isfinite(area)) pieces.area[n] += area;
    }
    return pieces;
}

}  // namespace stipple::scene
