// Where a triangle is closest to a point.
#pragma once

#include <glm/glm.hpp>

namespace stipple::lod {

/// Share of a part; 0 of nothing: simplification leaves triangles without an area.
template <typename T>
T shareOf(T part, T whole) {
    return whole > 0 ? part / whole : T(0);
}

/// Closest point of a triangle (Ericson, Real-Time Collision Detection, 5.1.5) as weights of b and c.
template <typename T>
[[gnu::always_inline]] inline glm::vec<2, T> closestWeights(const glm::vec<3, T>& p, const glm::vec<3, T>& a,
                                                            const glm::vec<3, T>& b, const glm::vec<3, T>& c) {
    const glm::vec<3, T> ab = b - a, ac = c - a, ap = p - a;
    const T d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return {0, 0};
    const glm::vec<3, T> bp = p - b;
    const T d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return {1, 0};
    const T vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return {shareOf(d1, d1 - d3), 0};
    const glm::vec<3, T> cp = p - c;
    const T d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return {0, 1};
    const T vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return {0, shareOf(d2, d2 - d6)};
    const T va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        const T w = shareOf(d4 - d3, (d4 - d3) + (d5 - d6));
        return {1 - w, w};
    }
    return {shareOf(vb, va + vb + vc), shareOf(vc, va + vb + vc)};
}

}  // namespace stipple::lod
