#include "lod/build/strands/strand_coverage.h"

#include <algorithm>
#include <array>
#include <cmath>

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

/// Pixels that something covers.
class Grid {
  public:
    Grid(const dvec2& least, const dvec2& greatest, double pixel)
        : least_(least),
          pixel_(pixel),
          width_(static_cast<int>((greatest.x - least.x) / pixel) + 2),
          height_(static_cast<int>((greatest.y - least.y) / pixel) + 2),
          covered_(static_cast<size_t>(width_) * static_cast<size_t>(height_)) {}

    /// Pixels around `centre`, no farther than `reach`, whose offset from it (in units) `isInside` says so of.
    template <typename IsInside>
    void cover(const dvec2& centre, const dvec2& reach, const IsInside& isInside) {
        const auto first = [&](double v, double least) {
            return static_cast<int>(std::ceil((v - least) / pixel_ - 0.5));
        };
        const int x0 = std::max(first(centre.x - reach.x, least_.x), 0),
                  x1 = std::min(first(centre.x + reach.x, least_.x), width_),
                  y0 = std::max(first(centre.y - reach.y, least_.y), 0),
                  y1 = std::min(first(centre.y + reach.y, least_.y), height_);
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x)
                if (isInside(least_ + pixel_ * dvec2(x + 0.5, y + 0.5) - centre))
                    covered_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)] = 1;
    }
    double area() const {
        return static_cast<double>(std::count(covered_.begin(), covered_.end(), 1)) * pixel_ * pixel_;
    }

  private:
    dvec2 least_;
    double pixel_;
    int width_, height_;
    std::vector<uint8_t> covered_;
};

class Coverage {
  public:
    Coverage(const StrandSet& strands, const Direction& direction) : strands_(strands), d_(direction) {
        for (const dvec3& p : strands.position) {
            least_ = glm::min(least_, flat(p));
            greatest_ = glm::max(greatest_, flat(p));
        }
        const double widest = *std::max_element(strands.radius.begin(), strands.radius.end());
        least_ -= widest;
        greatest_ += widest;
    }

    double ofStrands() const {
        constexpr double kPixels = 4096;
        Grid grid(least_, greatest_, std::max(greatest_.x - least_.x, greatest_.y - least_.y) / kPixels);
        for (size_t s = 0; s < strands_.strands(); ++s)
            for (uint32_t i = strands_.first[s]; i + 1 < strands_.first[s + 1]; ++i) addSegment(s, i, grid);
        return grid.area();
    }

    /// Of the first `count` samples, discs of this radius.
    double ofDiscs(const StrandSamples& samples, size_t count, double radius) const {
        Grid grid(least_ - radius, greatest_ + radius, radius / 4);
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
        const dvec2 a = flat(strands_.position[i]), b = flat(strands_.position[i + 1]), along = b - a;
        const double ra = strands_.radius[i], rb = strands_.radius[i + 1], length = glm::length(along);
        dvec2 across(0);
        if (strands_.isRibbon[s] != 0) {
            const dvec3 t = glm::normalize(strands_.position[i + 1] - strands_.position[i]);
            const dvec3 w = glm::cross(dvec3(strands_.normal[i]), t);
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

    const StrandSet& strands_;
    const Direction& d_;
    dvec2 least_{1e300}, greatest_{-1e300};
};

}  // namespace

std::vector<float> coverageFactors(const StrandSet& strands, const StrandSamples& samples, Executor& executor) {
    constexpr size_t kFewest = 48, kMostDiscs = 131072;
    constexpr int kSteps = 4;
    constexpr double kLeast = 0.3, kMost = 1.15;
    const std::array<Direction, 4> from = directions();
    std::vector<Coverage> views;
    views.reserve(from.size());
    for (const Direction& d : from) views.emplace_back(strands, d);
    const auto sum = [&](const auto& areaOf) {
        std::array<double, 4> areas{};
        executor.parallelFor(from.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) areas.at(k) = areaOf(views[k]);
        });
        return areas[0] + areas[1] + areas[2] + areas[3];
    };
    const double wanted = sum([](const Coverage& c) { return c.ofStrands(); });
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
