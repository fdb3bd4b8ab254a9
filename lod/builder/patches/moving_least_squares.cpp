#include "lod/builder/patches/moving_least_squares.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/numbers.h"
#include "lod/builder/patches/sheet_fit.h"
#include "shaders/shared/record.h"

namespace stipple::lod {
namespace {

constexpr size_t kNeighbours = 16, kFewest = 5, kForQuadratic = 10;
constexpr double kUsualReach = 2.5, kFarReach = 4;  ///< spacings, of neighbours; the farther where there are few
constexpr double kSupport = 1.5;                    ///< h, spacings
constexpr double kSameSide = 0.3;                   ///< cosine between normals of one sheet
constexpr double kSheet = 0.75;                     ///< h, from the plane of the guide
constexpr double kBesideBorder = 0.7;               ///< spacings, as far as the surface goes on beyond its last points
constexpr double kSteepest = 3.732;                 ///< tan 75 degrees
constexpr double kLoose = 0.25;                     ///< h, of the weighted residuals

float squaredReach(float spacing, bool isFar) {
    const double limit = (isFar ? kFarReach : kUsualReach) * static_cast<double>(spacing);
    return toFloat(limit * limit);
}

/// Do the points leave half of all directions in the plane empty?
bool isOneSided(const FitPoints& f) {
    uint32_t sectors = 0;
    for (size_t k = 0; k < f.n; ++k) {
        const double x = f.x[k], y = f.y[k];
        const uint32_t sector = (x < 0 ? 4u : 0u) | (y < 0 ? 2u : 0u) | (std::abs(x) < std::abs(y) ? 1u : 0u);
        // In their order around: 0, 1, 5, 4, 6, 7, 3, 2.
        static constexpr std::array<uint32_t, 8> kAround{0, 1, 7, 6, 3, 2, 4, 5};
        sectors |= 1u << kAround.at(sector);
    }
    uint32_t empty = ~sectors & 255u;
    empty |= empty << 8;
    return (empty & empty >> 1 & empty >> 2 & empty >> 3) != 0;
}

/// The points of the guide's sheet around a place.
void gather(PlacesNear& places, const glm::dvec3& place, const glm::dmat3& frame, uint32_t guide, double h,
            FitPoints& f) {
    const PointSurface& s = places.surface();
    const glm::dvec3 sheet(s.elements.normal[guide]), from = s.elements.centre[guide];
    const glm::dmat3 toLocal = glm::transpose(frame) * (1 / h);
    NearPoints::Found near;
    for (const bool isFar : {false, true}) {
        places.find(place, guide, isFar, near);
        f.n = 0;
        for (size_t k = 0; k < near.count; ++k) {
            const uint32_t i = near.index[k];
            const glm::dvec3& p = s.elements.centre[i];
            if (s.isSurface[i] == 0 || !(glm::dot(glm::dvec3(s.elements.normal[i]), sheet) > kSameSide) ||
                !(std::abs(glm::dot(p - from, sheet)) <= kSheet * h))
                continue;
            const glm::dvec3 q = toLocal * (p - place);
            f.x[f.n] = q.x;
            f.y[f.n] = q.y;
            f.z[f.n] = q.z;
            f.index[f.n] = i;
            f.squared[f.n] = q.x * q.x + q.y * q.y;
            ++f.n;
        }
        if (f.n >= kForQuadratic) return;
    }
}

const std::array<float, 256>& linearTable() {
    static const std::array<float, 256> kTable = [] {
        std::array<float, 256> t{};
        for (size_t k = 0; k < 256; ++k) t.at(k) = shared::linearFromSrgb(static_cast<float>(k) / 255.0f);
        return t;
    }();
    return kTable;
}

}  // namespace

PlacesNear::PlacesNear(const PointSurface& surface, std::span<const glm::dvec3> places,
                       std::span<const uint32_t> guides)
    : surface_(surface) {
    for (size_t k = 0; k < places.size(); ++k) {
        lo_ = glm::min(lo_, places[k]);
        hi_ = glm::max(hi_, places[k]);
        spacing_ = std::max(spacing_, surface.spacing[guides[k]]);
    }
}

void PlacesNear::find(const glm::dvec3& place, uint32_t guide, bool isFar, NearPoints::Found& near) {
    const size_t k = isFar ? 1 : 0;
    if (!isKnown_.at(k)) surface_.near.runsNear(lo_, hi_, squaredReach(spacing_, isFar), runs_.at(k));
    isKnown_.at(k) = true;
    surface_.near.find(runs_.at(k), place, kNeighbours, squaredReach(surface_.spacing[guide], isFar), near);
}

bool leastSquaresAt(PlacesNear& places, const glm::dvec3& place, const glm::dmat3& frame, uint32_t guide,
                    LeastSquaresSample& sample) {
    const PointSurface& s = places.surface();
    const auto spacing = static_cast<double>(s.spacing[guide]);
    const double h = kSupport * spacing;
    if (!(h > 0)) return false;
    FitPoints f;
    gather(places, place, frame, guide, h, f);
    if (f.n < kFewest) return false;
    const bool isBorder = isOneSided(f);
    SheetFit fit;
    if (!fitSheet(f, f.n >= kForQuadratic && !isBorder, fit)) return false;
    const FitTerms& c = fit.terms;
    const double height = fit.height;
    if (c[1] * c[1] + c[2] * c[2] > kSteepest * kSteepest || fit.loose > kLoose) return false;
    double closest = 1e300;
    for (size_t k = 0; k < f.n; ++k) {
        const double d = f.z[k] - height, squared = f.squared[k] + d * d;
        if (squared >= closest) continue;
        closest = squared;
        sample.nearestPoint = f.index[k];
    }
    closest = std::sqrt(closest);
    if (isBorder && closest * h > kBesideBorder * spacing) return false;
    sample.height = height * h;
    sample.slope = {c[1], c[2]};
    sample.nearest = closest * h;
    if (s.colour.empty()) return true;
    glm::dvec3 sum(0);
    double weights = 0;
    for (size_t k = 0; k < f.n; ++k) {
        const uint32_t rgb = s.colour[f.index[k]];
        const auto& linear = linearTable();
        sum += f.weight[k] * glm::dvec3(linear.at(rgb & 255u), linear.at(rgb >> 8 & 255u), linear.at(rgb >> 16 & 255u));
        weights += f.weight[k];
    }
    sample.colour = glm::vec3(sum / weights);
    return true;
}

}  // namespace stipple::lod
