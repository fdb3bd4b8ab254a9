#include "engine/reference/variants/discs.h"

#include <algorithm>
#include <cmath>

namespace stipple::reference {
namespace {

using glm::dvec2;
using glm::dvec3;

dvec3 towardsEye(const PlacedDisc& d, const lod::View& v) {
    return glm::dot(d.normal, sightOf(v, d.centre)) > 0 ? -d.normal : d.normal;
}
bool isLeaf(const PlacedDisc& d) { return (d.flags & shared::kFlagLeaf) != 0; }

/// Calls use(x, y, off) for the pixels within `reach` px of the disc's centre along each axis; `off` leads from there.
template <typename Use>
void forPixels(const lod::View& v, const Level& level, const PlacedDisc& d, double reach, const Use& use) {
    if (!(d.centre.z > v.nearPlane)) return;
    const dvec2 p = imageOf(v, d.centre);
    const auto clamp = [](double at, int most) { return static_cast<int>(std::clamp(at, -1.0, most + 1.0)); };
    for (int y = std::max(0, clamp(p.y - reach, level.height - 1));
         y <= std::min(level.height - 1, clamp(p.y + reach, level.height - 1)); ++y)
        for (int x = std::max(0, clamp(p.x - reach, level.width - 1));
             x <= std::min(level.width - 1, clamp(p.x + reach, level.width - 1)); ++x)
            use(x, y, dvec2(x + 0.5, y + 0.5) - p);
}

void offer(const lod::View& v, Level& level, int x, int y, const PlacedDisc& d) {
    Sample& s = level.ref(x, y);
    if (s.valid && s.key <= d.centre.z) return;
    s = shownPixel(v, dvec2(x + 0.5, y + 0.5), d.centre.z, towardsEye(d, v), d.colour, isLeaf(d));
}

/// Distance on the disc from its centre to where a pixel's ray meets its plane, in radii; infinite where it does not.
double radiiOnDisc(const lod::View& v, const PlacedDisc& d, int x, int y) {
    const ViewRay ray = viewRay(v, dvec2(x + 0.5, y + 0.5));
    const double depth = glm::dot(d.normal, d.centre - ray.origin) / glm::dot(d.normal, ray.direction);
    return depth > v.nearPlane ? glm::length(ray.at(depth) - d.centre) / d.radius : HUGE_VAL;
}

/// Pixels that a disc may reach: its sphere is seen that wide at most, off the axis too.
double reachOf(const lod::View& v, const PlacedDisc& d) {
    if (v.isOrthographic) return d.radius * v.focalPixels + 1;
    const double nearest = std::max(d.centre.z - d.radius, 0.05 * d.centre.z);
    return d.radius * v.focalPixels / nearest * (1 + glm::length(d.centre) / nearest) + 1;
}

}  // namespace

void showSquares(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    for (const PlacedDisc& d : discs) {
        const double half = d.radius * pixelsAt(draws.view, d.centre.z);
        forPixels(draws.view, level, d, std::max(half, 0.5) + 1, [&](int x, int y, const dvec2& off) {
            if (std::max(std::abs(off.x), std::abs(off.y)) <= std::max(half, 0.5)) offer(draws.view, level, x, y, d);
        });
    }
}

void showCircles(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    for (const PlacedDisc& d : discs) {
        const double radius = std::max(d.radius * pixelsAt(draws.view, d.centre.z), 0.7071);
        forPixels(draws.view, level, d, radius + 1, [&](int x, int y, const dvec2& off) {
            if (glm::length(off) <= radius) offer(draws.view, level, x, y, d);
        });
    }
}

void showFlatDepth(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    for (const PlacedDisc& d : discs)
        forPixels(draws.view, level, d, reachOf(draws.view, d), [&](int x, int y, const dvec2& off) {
            const bool isCentre = std::max(std::abs(off.x), std::abs(off.y)) <= 0.5;
            if (isCentre || radiiOnDisc(draws.view, d, x, y) <= 1) offer(draws.view, level, x, y, d);
        });
}

void showReduced(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    std::vector<PlacedDisc> smaller = discs;
    for (PlacedDisc& d : smaller) d.radius *= 0.5;
    showSplats(draws, smaller, level);
}

void blendSorted(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    const lod::View& v = draws.view;
    std::vector<const PlacedDisc*> farFirst;
    for (const PlacedDisc& d : discs) farFirst.push_back(&d);
    std::stable_sort(farFirst.begin(), farFirst.end(),
                     [](const PlacedDisc* a, const PlacedDisc* b) { return a->centre.z > b->centre.z; });
    struct Sum {
        double alpha = 0;
        dvec3 colour{0}, normal{0};
    };
    std::vector<Sum> sums(level.samples.size());
    for (const PlacedDisc* d : farFirst)
        forPixels(v, level, *d, reachOf(v, *d), [&](int x, int y, const dvec2&) {
            const double rho = radiiOnDisc(v, *d, x, y);
            Sample& s = level.ref(x, y);
            if (!(rho <= 1) || (s.isTriangle && s.depth < d->centre.z)) return;
            const double w = std::exp(-2 * rho * rho);  // two sigmas to the rim
            Sum& sum = sums[static_cast<size_t>(&s - level.samples.data())];
            sum.alpha += w * (1 - sum.alpha);
            sum.colour = glm::mix(sum.colour, d->colour, w);  // premultiplied
            sum.normal = glm::mix(sum.normal, towardsEye(*d, v), w);
            s = shownPixel(v, dvec2(x + 0.5, y + 0.5), d->centre.z, glm::normalize(sum.normal), sum.colour / sum.alpha,
                           isLeaf(*d));
            s.coverage = sum.alpha;
        });
}

void blendMovedAway(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    blendDiscs(draws, discs, level, {.movesDiscsAway = true});
}

void blendUnnormalised(const render::DrawList& draws, const std::vector<PlacedDisc>& discs, Level& level) {
    blendDiscs(draws, discs, level, {.isNormalised = false});
}

}  // namespace stipple::reference
