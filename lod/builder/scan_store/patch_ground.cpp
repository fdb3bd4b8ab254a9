// A triangle is no farther from the ground than its middle is, and the way from there to its corners more; nor than its
// corners are from one facet, which is convex. It is quartered until that says enough, or is small itself.
#include "lod/builder/scan_store/patch_ground.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lod/primitives/triangle.h"

namespace stipple::lod {
namespace {

constexpr int kDeepest = 5;
constexpr double kNear = 0.05;   ///< limits: nearer than that nobody looks for what is nearer still
constexpr double kSmall = 0.25;  ///< way from the middle, in limits, that is not divided
constexpr double kInfinite = std::numeric_limits<double>::infinity();

double squaredDistance(const glm::dvec3& p, const PatchGround::Triangle& t) {
    const glm::dvec2 w = closestWeights(p, t[0], t[1], t[2]);
    const glm::dvec3 d = p - (t[0] + w.x * (t[1] - t[0]) + w.y * (t[2] - t[0]));
    return glm::dot(d, d);
}

}  // namespace

void PatchGround::add(const std::vector<Patch>& patches, const glm::dvec3& corner) {
    for (const Patch& p : patches) {
        const glm::dmat3 frame = p.frame();
        const auto [lo, hi] = std::minmax_element(p.heights.begin(), p.heights.end());
        const double step = p.step, quantum = p.quantum();
        const glm::dvec3 size((p.width - 1) * step, (p.height - 1) * step, (*hi - *lo) * quantum);
        const glm::dvec3 middle = 0.5 * size + glm::dvec3(0, 0, *lo * quantum);
        const glm::dvec3 origin = corner + p.origin;
        grounds_.push_back(
            {&p, origin, glm::transpose(frame), origin + frame * middle, 0.5 * glm::length(size), step, quantum});
    }
}

double PatchGround::boundOf(const Triangle& triangle, double limit, double enough, uint32_t& hint) const {
    return bound(triangle, limit, enough, kDeepest, hint);
}

double PatchGround::bound(const Triangle& t, double limit, double enough, int depth, uint32_t& hint) const {
    const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0;
    Facet facet{0, {}, limit * limit};
    nearest(middle, hint, facet);
    if (!(facet.squared < limit * limit)) return kInfinite;
    double way = 0, corners = 0;
    const Ground& g = grounds_[facet.ground];
    for (const glm::dvec3& p : t) {
        const glm::dvec3 d = p - middle;
        way = std::max(way, glm::dot(d, d));
        corners = std::max(corners, squaredDistance(g.local(p), facet.at));
    }
    way = std::sqrt(way);
    const double most = std::min(std::sqrt(facet.squared) + way, std::sqrt(corners));
    if (most <= enough || depth == 0 || way <= kSmall * limit) return most;
    const glm::dvec3 ab = 0.5 * (t[0] + t[1]), bc = 0.5 * (t[1] + t[2]), ca = 0.5 * (t[2] + t[0]);
    double worst = 0;
    for (const Triangle& part : {Triangle{ab, bc, ca}, {t[0], ab, ca}, {ab, t[1], bc}, {ca, bc, t[2]}}) {
        worst = std::max(worst, bound(part, limit, std::max(enough, worst), depth - 1, hint));
        if (!std::isfinite(worst)) return worst;
    }
    return std::min(most, worst);
}

/// `facet.squared`: of the limit before. What lies right under the place is near enough to what is nearest.
void PatchGround::nearest(const glm::dvec3& p, uint32_t& hint, Facet& facet) const {
    const double limit = facet.squared;
    if (hint < grounds_.size()) {
        under(hint, p, facet);
        if (facet.squared < kNear * kNear * limit) return;
    }
    for (const bool isAround : {false, true}) {
        for (uint32_t k = 0; k < grounds_.size(); ++k) {
            const Ground& g = grounds_[k];
            const double reach = g.radius + std::sqrt(facet.squared);
            const glm::dvec3 d = p - g.centre;
            if (glm::dot(d, d) > reach * reach) continue;
            const double before = facet.squared;
            if (isAround)
                around(k, p, facet);
            else
                under(k, p, facet);
            if (facet.squared < before) hint = k;
        }
        if (facet.squared < limit) return;
    }
}

void PatchGround::under(uint32_t ground, const glm::dvec3& p, Facet& facet) const {
    const Ground& g = grounds_[ground];
    const glm::dvec3 q = g.local(p);
    const double i = std::floor(q.x / g.step), j = std::floor(q.y / g.step);
    if (!(i >= 0 && j >= 0 && i + 1 < g.patch->width && j + 1 < g.patch->height)) return;
    atCell(ground, q, static_cast<uint32_t>(i), static_cast<uint32_t>(j), facet);
}

void PatchGround::around(uint32_t ground, const glm::dvec3& p, Facet& facet) const {
    const Ground& g = grounds_[ground];
    const double step = g.step, reach = std::sqrt(facet.squared);
    const glm::dvec3 q = g.local(p);
    const auto first = [&](double at) { return std::max(0.0, std::floor((at - reach) / step)); };
    const auto last = [&](double at, uint32_t n) { return std::min(std::floor((at + reach) / step), n - 2.0); };
    for (double j = first(q.y); j <= last(q.y, g.patch->height); ++j)
        for (double i = first(q.x); i <= last(q.x, g.patch->width); ++i)
            atCell(ground, q, static_cast<uint32_t>(i), static_cast<uint32_t>(j), facet);
}

void PatchGround::atCell(uint32_t ground, const glm::dvec3& q, uint32_t i, uint32_t j, Facet& facet) const {
    const Ground& g = grounds_[ground];
    if (!g.patch->hasCell(i, j)) return;
    const size_t s = g.patch->at(i, j);
    const uint16_t* const h = g.patch->heights.data() + s;
    const size_t w = g.patch->width;
    const auto [low, high] = std::minmax({h[0], h[1], h[w], h[w + 1]});
    const double off = std::max({0.0, low * g.quantum - q.z, q.z - high * g.quantum});
    if (off * off >= facet.squared) return;
    const double x = i * g.step, y = j * g.step;
    const std::array<glm::dvec3, 4> corner{
        glm::dvec3(x, y, h[0] * g.quantum), glm::dvec3(x + g.step, y, h[1] * g.quantum),
        glm::dvec3(x, y + g.step, h[w] * g.quantum), glm::dvec3(x + g.step, y + g.step, h[w + 1] * g.quantum)};
    const auto& t = cellTriangles(h[0], h[1], h[w], h[w + 1]);
    for (size_t k = 0; k < 6; k += 3) {
        const Triangle triangle{corner[t[k]], corner[t[k + 1]], corner[t[k + 2]]};
        const double squared = squaredDistance(q, triangle);
        if (squared < facet.squared) facet = {ground, triangle, squared};
    }
}

}  // namespace stipple::lod
