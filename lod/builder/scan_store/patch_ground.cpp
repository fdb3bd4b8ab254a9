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
constexpr double kSmall = 0.25;  ///< way from the middle, in limits, that is not divided
constexpr double kInfinite = std::numeric_limits<double>::infinity();

double distanceTo(const glm::dvec3& p, const PatchGround::Triangle& t) {
    const glm::dvec2 w = closestWeights(p, t[0], t[1], t[2]);
    return glm::distance(p, t[0] + w.x * (t[1] - t[0]) + w.y * (t[2] - t[0]));
}

}  // namespace

void PatchGround::add(const std::vector<Patch>& patches, const glm::dvec3& corner) {
    for (const Patch& p : patches) {
        const PatchSurface surface(p);
        const auto [lo, hi] = std::minmax_element(p.heights.begin(), p.heights.end());
        const double step = p.step;
        const glm::dvec3 size((p.width - 1) * step, (p.height - 1) * step, (*hi - *lo) * p.quantum());
        const glm::dvec3 middle = 0.5 * size + glm::dvec3(0, 0, *lo * p.quantum());
        const glm::dvec3 origin = corner + p.origin;
        grounds_.push_back({&p, surface, corner, origin, glm::transpose(surface.frame()),
                            origin + surface.frame() * middle, 0.5 * glm::length(size)});
    }
}

double PatchGround::boundOf(const Triangle& triangle, double limit, double enough, uint32_t& hint) const {
    return bound(triangle, limit, enough, kDeepest, hint);
}

double PatchGround::bound(const Triangle& t, double limit, double enough, int depth, uint32_t& hint) const {
    const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0;
    Facet facet{{}, limit};
    nearest(middle, hint, facet);
    if (!(facet.distance < limit)) return kInfinite;
    double way = 0, corners = 0;
    for (const glm::dvec3& p : t) {
        way = std::max(way, glm::distance(p, middle));
        corners = std::max(corners, distanceTo(p, facet.at));
    }
    const double most = std::min(facet.distance + way, corners);
    if (most <= enough || depth == 0 || way <= kSmall * limit) return most;
    const glm::dvec3 ab = 0.5 * (t[0] + t[1]), bc = 0.5 * (t[1] + t[2]), ca = 0.5 * (t[2] + t[0]);
    double worst = 0;
    for (const Triangle& part : {Triangle{ab, bc, ca}, {t[0], ab, ca}, {ab, t[1], bc}, {ca, bc, t[2]}}) {
        worst = std::max(worst, bound(part, limit, std::max(enough, worst), depth - 1, hint));
        if (!std::isfinite(worst)) return worst;
    }
    return std::min(most, worst);
}

/// `facet.distance`: the limit before. What lies right under the place is near enough to what is nearest.
void PatchGround::nearest(const glm::dvec3& p, uint32_t& hint, Facet& facet) const {
    const double limit = facet.distance;
    if (hint < grounds_.size()) {
        under(grounds_[hint], p, facet);
        if (facet.distance < 0.05 * limit) return;
    }
    for (const bool isAround : {false, true}) {
        for (uint32_t k = 0; k < grounds_.size(); ++k) {
            const Ground& g = grounds_[k];
            const double reach = g.radius + facet.distance;
            const glm::dvec3 d = p - g.centre;
            if (glm::dot(d, d) > reach * reach) continue;
            const double before = facet.distance;
            if (isAround)
                around(g, p, facet);
            else
                under(g, p, facet);
            if (facet.distance < before) hint = k;
        }
        if (facet.distance < limit) return;
    }
}

void PatchGround::under(const Ground& g, const glm::dvec3& p, Facet& facet) {
    const glm::dvec3 q = g.toLocal * (p - g.origin) / double{g.patch->step};
    const double i = std::floor(q.x), j = std::floor(q.y);
    if (!(i >= 0 && j >= 0 && i + 1 < g.patch->width && j + 1 < g.patch->height)) return;
    atCell(g, p, static_cast<uint32_t>(i), static_cast<uint32_t>(j), facet);
}

void PatchGround::around(const Ground& g, const glm::dvec3& p, Facet& facet) {
    const double step = g.patch->step, reach = facet.distance;
    const glm::dvec3 q = g.toLocal * (p - g.origin);
    const auto first = [&](double at) { return std::max(0.0, std::floor((at - reach) / step)); };
    const auto last = [&](double at, uint32_t n) { return std::min(std::floor((at + reach) / step), n - 2.0); };
    for (double j = first(q.y); j <= last(q.y, g.patch->height); ++j)
        for (double i = first(q.x); i <= last(q.x, g.patch->width); ++i)
            atCell(g, p, static_cast<uint32_t>(i), static_cast<uint32_t>(j), facet);
}

void PatchGround::atCell(const Ground& g, const glm::dvec3& p, uint32_t i, uint32_t j, Facet& facet) {
    if (!g.patch->hasCell(i, j)) return;
    g.surface.trianglesOf(i, j, [&](size_t a, size_t b, size_t c) {
        const Triangle t{g.corner + g.surface.position(a), g.corner + g.surface.position(b),
                         g.corner + g.surface.position(c)};
        const double d = distanceTo(p, t);
        if (d < facet.distance) facet = {t, d};
    });
}

}  // namespace stipple::lod
