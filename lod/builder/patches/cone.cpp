#include "lod/builder/patches/cone.h"

#include <algorithm>
#include <cmath>

namespace stipple::lod {
namespace {

constexpr double kOutside = 1e-9;  ///< of squared distances: what is farther out is outside

struct Ball {
    glm::dvec3 centre{0};
    double squared = -1;  ///< of the radius; -1: of nothing
    bool holds(const glm::dvec3& p) const {
        const glm::dvec3 d = p - centre;
        return glm::dot(d, d) <= squared + kOutside;
    }
};

/// The smallest ball with all of `p` on its surface; nothing where they lie on a line or in a plane (for their number).
bool circumscribed(const std::array<glm::dvec3, 4>& p, size_t n, Ball& ball) {
    ball.centre = p[0];
    if (n == 2) {
        ball.centre = 0.5 * (p[0] + p[1]);
    } else if (n == 3) {
        const glm::dvec3 a = p[1] - p[0], b = p[2] - p[0], c = glm::cross(a, b);
        const double area = glm::dot(c, c);
        if (!(area > 1e-24)) return false;
        ball.centre += (glm::cross(c, a) * glm::dot(b, b) + glm::cross(b, c) * glm::dot(a, a)) / (2 * area);
    } else if (n == 4) {
        const glm::dvec3 a = p[1] - p[0], b = p[2] - p[0], c = p[3] - p[0];
        const double volume = glm::dot(a, glm::cross(b, c));
        if (!(std::abs(volume) > 1e-18)) return false;
        ball.centre += (glm::dot(a, a) * glm::cross(b, c) + glm::dot(b, b) * glm::cross(c, a) +
                        glm::dot(c, c) * glm::cross(a, b)) /
                       (2 * volume);
    }
    const glm::dvec3 d = p[0] - ball.centre;
    ball.squared = glm::dot(d, d);
    return true;
}

/// Of at most five points: by all their subsets. Leaves those on its surface in `points`.
Ball smallestOfFew(std::array<glm::dvec3, 5>& points, size_t& n) {
    Ball best;
    uint32_t bestSet = 0;
    for (uint32_t set = 1; set < 1u << n; ++set) {
        std::array<glm::dvec3, 4> on{};
        size_t size = 0;
        bool isSmall = true;
        for (size_t k = 0; k < n && isSmall; ++k)
            if (set >> k & 1u) {
                isSmall = size < 4;
                if (isSmall) on.at(size++) = points.at(k);
            }
        Ball ball;
        if (!isSmall || !circumscribed(on, size, ball)) continue;
        if (best.squared >= 0 && ball.squared >= best.squared) continue;
        bool holdsAll = true;
        for (size_t k = 0; k < n; ++k) holdsAll = holdsAll && ((set >> k & 1u) != 0 || ball.holds(points.at(k)));
        if (!holdsAll) continue;
        best = ball;
        bestSet = set;
    }
    size_t size = 0;
    for (size_t k = 0; k < n; ++k)
        if (bestSet >> k & 1u) points.at(size++) = points.at(k);
    n = size;
    return best;
}

NormalCone coneOfBall(const Ball& ball, const std::array<glm::dvec3, 5>& support, size_t n) {
    NormalCone cone;
    const double length = glm::length(ball.centre);
    // Opposite normals have a ball about the origin, which has no direction.
    cone.cosine = length > 1e-6 && ball.squared < 1 ? std::min(length, 1.0) : -1;
    if (cone.cosine > 0) cone.axis = ball.centre / length;
    cone.supports = static_cast<uint32_t>(std::min<size_t>(n, 4));
    for (size_t k = 0; k < cone.supports; ++k) cone.support.at(k) = support.at(k);
    return cone;
}

/// `normal(k)` for k < count. Grows the ball by whatever is farthest out: its radius rises with every step, so it ends.
template <typename Normal>
NormalCone growing(size_t count, const Normal& normal, double least) {
    constexpr int kMostSteps = 64;
    std::array<glm::dvec3, 5> support{};
    support[0] = normal(0);
    size_t n = 1;
    Ball ball{support[0], 0};
    for (int step = 0; step < kMostSteps; ++step) {
        size_t farthest = 0;
        double most = -1;
        for (size_t k = 0; k < count; ++k) {
            const glm::dvec3 d = normal(k) - ball.centre;
            const double squared = glm::dot(d, d);
            if (squared > most) {
                most = squared;
                farthest = k;
            }
        }
        if (most <= ball.squared + kOutside) break;
        support.at(n++) = normal(farthest);
        const Ball larger = smallestOfFew(support, n);
        if (!(larger.squared > ball.squared)) break;  // only rounding is left
        ball = larger;
        if (glm::length(ball.centre) < least) break;
    }
    NormalCone cone = coneOfBall(ball, support, n);
    if (cone.cosine >= least && cone.cosine > 0)  // what is stated holds for all, rounding included
        for (size_t k = 0; k < count; ++k) cone.cosine = std::min(cone.cosine, glm::dot(normal(k), cone.axis));
    return cone;
}

}  // namespace

NormalCone coneOf(std::span<const glm::vec3> normal, std::span<const uint32_t> of, double least) {
    return growing(
        of.size(), [&](size_t k) { return glm::dvec3(normal[of[k]]); }, least);
}

NormalCone coneOf(std::span<const glm::dvec3> normals) {
    return growing(
        normals.size(), [&](size_t k) { return normals[k]; }, -1);
}

bool mayFit(const NormalCone& a, const NormalCone& b, double leastCosine, NormalCone& both) {
    if (a.cosine <= 0 || b.cosine <= 0) return false;
    std::array<glm::dvec3, 8> rims{};
    size_t n = 0;
    for (const NormalCone* cone : {&a, &b})
        for (uint32_t k = 0; k < cone->supports; ++k) rims.at(n++) = cone->support.at(k);
    both = coneOf(std::span<const glm::dvec3>(rims.data(), n));
    if (both.cosine < leastCosine) return false;  // so do all normals: these are some of them
    // From any axis, a cone's normals are within its half angle of its own axis.
    const auto widest = [&](const glm::dvec3& axis) {
        double most = 0;
        for (const NormalCone* cone : {&a, &b})
            most = std::max(most, std::acos(std::clamp(glm::dot(axis, cone->axis), -1.0, 1.0)) +
                                      std::acos(std::clamp(cone->cosine, -1.0, 1.0)));
        return most < 1.5 ? std::cos(most) : -1;
    };
    const glm::dvec3 own = both.axis;
    both.cosine = -1;
    for (const glm::dvec3& axis : {own, a.axis, b.axis})
        if (const double cosine = widest(axis); cosine > both.cosine) {
            both.cosine = cosine;
            both.axis = axis;
        }
    return true;
}

}  // namespace stipple::lod
