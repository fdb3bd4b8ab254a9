#include "lod/builder/curves/curve_coverage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace stipple::lod {
namespace {

using glm::dvec2;
using glm::dvec3;

/// A parallel projection.
struct Direction {
    dvec3 x, y, z;
};
/// From the side all round, and from above.
std::array<Direction, 4> directions() {
    std::array<Direction, 4> out;
    for (size_t k = 0; k < out.size(); ++k) {
        const double a = 0.4 + 2.1 * static_cast<double>(k), up = k + 1 < out.size() ? 0.15 : 1.2;
        const dvec3 z(std::cos(a) * std::cos(up), std::sin(up), std::sin(a) * std::cos(up));
        const dvec3 x = glm::normalize(glm::cross(dvec3(0, 1, 0), z));
        out.at(k) = {x, glm::cross(z, x), z};
    }
    return out;
}

/// What is looked at of a parallel projection.
struct Window {
    dvec2 least{1e300}, greatest{-1e300};
    dvec2 size() const { return greatest - least; }
};

/// Where nearly all of `places` lie, and as much again on each side, if some lie so far off that the others would be
/// specks beside them; else the box of all.
Window windowOf(const std::vector<dvec2>& places, double margin) {
    constexpr double kFar = 32;
    Window all, core;
    for (const dvec2& p : places) {
        all.least = glm::min(all.least, p);
        all.greatest = glm::max(all.greatest, p);
    }
    std::vector<double> sorted(places.size());
    const size_t few = (places.size() + 49) / 50, last = places.size() - 1;
    for (int axis = 0; axis < 2 && places.size() > 2 * few; ++axis) {
        std::transform(places.begin(), places.end(), sorted.begin(), [&](const dvec2& p) { return p[axis]; });
        const auto at = [&](size_t k) {
            std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(k), sorted.end());
            return sorted[k];
        };
        core.least[axis] = at(few);
        core.greatest[axis] = at(last - few);
    }
    const double extent = std::max(all.size().x, all.size().y), near = std::max(core.size().x, core.size().y);
    if (near > 0 && extent + 2 * margin > kFar * (near + 2 * margin)) all = {core.least - near, core.greatest + near};
    return {all.least - margin, all.greatest + margin};
}

/// Pixels that something covers. Large grids are kept as the small squares that are touched.
class Grid {
  public:
    Grid(const dvec2& least, const dvec2& greatest, double pixel)
        : least_(least),
          pixel_(pixel),
          width_(cells((greatest.x - least.x) / pixel) + 2),
          height_(cells((greatest.y - least.y) / pixel) + 2),
          isDense_(width_ * height_ <= kMostDense) {
        if (isDense_) covered_.resize(static_cast<size_t>(width_ * height_));
    }

    /// Pixels around `centre`, no farther than `reach`, whose offset from it (in units) `isInside` says so of.
    template <typename IsInside>
    void cover(const dvec2& centre, const dvec2& reach, const IsInside& isInside) {
        const auto first = [&](double v, double least, int64_t most) {
            return static_cast<int64_t>(
                std::clamp(std::ceil((v - least) / pixel_ - 0.5), 0.0, static_cast<double>(most)));
        };
        const int64_t x0 = first(centre.x - reach.x, least_.x, width_),
                      x1 = first(centre.x + reach.x, least_.x, width_),
                      y0 = first(centre.y - reach.y, least_.y, height_),
                      y1 = first(centre.y + reach.y, least_.y, height_);
        for (int64_t y = y0; y < y1; ++y)
            for (int64_t x = x0; x < x1; ++x)
                if (isInside(least_ + pixel_ * dvec2(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5) -
                             centre))
                    set(x, y);
    }
    double area() const {
        int64_t count = std::count(covered_.begin(), covered_.end(), 1);
        for (const auto& [key, square] : squares_)
            for (const uint32_t row : square) count += __builtin_popcount(row);
        return static_cast<double>(count) * pixel_ * pixel_;
    }

  private:
    static constexpr int64_t kMostDense = int64_t{1} << 25, kMostCells = int64_t{1} << 30;
    using Square = std::array<uint32_t, 32>;  ///< 32 x 32 pixels, a bit each

    static int64_t cells(double count) {
        return static_cast<int64_t>(std::clamp(count, 0.0, static_cast<double>(kMostCells)));
    }
    void set(int64_t x, int64_t y) {
        if (isDense_) {
            covered_[static_cast<size_t>(y * width_ + x)] = 1;
            return;
        }
        if (const int64_t key = (y >> 5) << 32 | x >> 5; key != lastKey_) {
            lastKey_ = key;
            last_ = &squares_[key];
        }
        (*last_)[static_cast<size_t>(y & 31)] |= 1u << (x & 31);
    }

    dvec2 least_;
    double pixel_;
    int64_t width_, height_;
    bool isDense_;
    std::vector<uint8_t> covered_;
    std::unordered_map<int64_t, Square> squares_;
    int64_t lastKey_ = -1;
    Square* last_ = nullptr;
};

class Coverage {
  public:
    Coverage(const CurveSet& curves, const Direction& direction) : curves_(curves), d_(direction) {
        std::vector<dvec2> places;
        places.reserve(curves.position.size());
        for (const dvec3& p : curves.position) places.push_back(flat(p));
        window_ = windowOf(places, *std::max_element(curves.radius.begin(), curves.radius.end()));
    }

    double ofCurves() const {
        constexpr double kPixels = 4096;
        const dvec2 size = window_.size();
        Grid grid(window_.least, window_.greatest, std::max(size.x, size.y) / kPixels);
        for (size_t s = 0; s < curves_.curves(); ++s)
            for (uint32_t i = curves_.first[s]; i + 1 < curves_.first[s + 1]; ++i) addSegment(s, i, grid);
        return grid.area();
    }

    /// Of the first `count` samples, discs of this radius.
    double ofDiscs(const CurveSamples& samples, size_t count, double radius) const {
        Grid grid(window_.least - radius, window_.greatest + radius, radius / 4);
        for (size_t k = 0; k < count; ++k) {
            const dvec3 n(samples.points.normal[k]);
            const dvec2 tilt(glm::dot(n, d_.x), glm::dot(n, d_.y));
            const double facing = std::abs(glm::dot(n, d_.z));
            const dvec2 reach = radius * glm::sqrt(glm::max(dvec2(1) - tilt * tilt, dvec2(0)));
            const double f2 = facing * facing, r2 = f2 * radius * radius;
            grid.cover(flat(samples.points.position[k]), reach, [&](const dvec2& o) {
                const double along = glm::dot(o, tilt);
                return f2 * glm::dot(o, o) + along * along <= r2;
            });
        }
        return grid.area();
    }

  private:
    dvec2 flat(const dvec3& p) const { return {glm::dot(p, d_.x), glm::dot(p, d_.y)}; }

    /// As a strip between its edges, as they are seen.
    void addSegment(size_t s, uint32_t i, Grid& grid) const {
        const dvec2 a = flat(curves_.position[i]), b = flat(curves_.position[i + 1]), along = b - a;
        const double ra = curves_.radius[i], rb = curves_.radius[i + 1], length = glm::length(along);
        dvec2 across(0);
        if (curves_.isRibbon[s] != 0) {
            const dvec3 t = glm::normalize(curves_.position[i + 1] - curves_.position[i]);
            const dvec3 w = glm::cross(dvec3(curves_.normal[i]), t);
            if (glm::length(w) > 1e-6) across = flat(glm::normalize(w));
        } else if (length > 0) {
            across = dvec2(-along.y, along.x) / length;
        }
        const double turn = along.x * across.y - along.y * across.x;
        if (!(std::abs(turn) > 1e-12)) return;
        const dvec2 middle = 0.5 * (a + b), reach = 0.5 * glm::abs(along) + std::max(ra, rb) * glm::abs(across);
        grid.cover(middle, reach, [&](const dvec2& o) {  // o + middle = a + u along + v across
            const dvec2 q = o + middle - a;
            const double u = (q.x * across.y - q.y * across.x) / turn, v = (along.x * q.y - along.y * q.x) / turn;
            return u >= 0 && u <= 1 && std::abs(v) <= ra + u * (rb - ra);
        });
    }

    const CurveSet& curves_;
    const Direction& d_;
    Window window_;
};

}  // namespace

std::vector<float> coverageFactors(const CurveSet& curves, const CurveSamples& samples, Executor& executor) {
    constexpr size_t kFewest = 48, kMostDiscs = 131072;
    constexpr int kSteps = 4;
    constexpr double kLeast = 0.3, kMost = 1.15;
    const std::array<Direction, 4> from = directions();
    std::vector<Coverage> views;
    views.reserve(from.size());
    for (const Direction& d : from) views.emplace_back(curves, d);
    const auto sum = [&](const auto& areaOf) {
        std::array<double, 4> areas{};
        executor.parallelFor(from.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) areas.at(k) = areaOf(views[k]);
        });
        return areas[0] + areas[1] + areas[2] + areas[3];
    };
    const double wanted = sum([](const Coverage& c) { return c.ofCurves(); });
    std::vector<float> factors;
    const size_t all = samples.points.position.size();
    for (size_t count = all; count >= kFewest || factors.empty(); count /= 2) {
        if (count > kMostDiscs) {  // several on one leaf: they cover what it covers
            factors.push_back(1);
            continue;
        }
        const double radius = samples.radius * std::sqrt(static_cast<double>(all) / static_cast<double>(count));
        double low = kLeast, high = kMost, factor = factors.empty() ? 1.0 : double{factors.back()};
        for (int step = 0; step < kSteps; ++step) {  // the area grows a little slower than the square of the radius
            const double area = sum([&](const Coverage& c) { return c.ofDiscs(samples, count, factor * radius); });
            (area > wanted ? high : low) = factor;
            factor = std::clamp(factor * std::pow(wanted / std::max(area, 1e-300), 0.7), low, high);
        }
        factors.push_back(static_cast<float>(factor));
        if (count < 2) break;
    }
    return factors;
}

}  // namespace stipple::lod
