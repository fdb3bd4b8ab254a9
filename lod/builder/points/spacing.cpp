#include "lod/builder/points/spacing.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace stipple::lod {
namespace {

constexpr size_t kNeighbour = 4;  ///< by rank; the distance of the first varies too much
constexpr size_t kFewest = 8;

/// Value at a share of the order.
double valueAt(std::vector<double>& values, double share) {
    const auto at = values.begin() + static_cast<ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

struct Range {
    double low, high;
};
Range rangeAlong(const std::vector<glm::dvec3>& places, int axis) {
    constexpr double kLow = 0.02, kHigh = 0.98;
    std::vector<double> values;
    values.reserve(places.size());
    for (const glm::dvec3& p : places) values.push_back(p[axis]);
    const double low = valueAt(values, kLow);
    return {low, valueAt(values, kHigh)};
}

/// Places in a tree of boxes: halves along the longest axis, so that it is balanced whatever the extents.
class PlaceTree {
  public:
    explicit PlaceTree(std::vector<glm::dvec3>& places) : places_(places) { split(0, places.size()); }

    /// Of places_[i] from its neighbour of rank kNeighbour.
    double distanceOf(size_t i) const {
        Nearest nearest;
        nearest.fill(1e300);
        search(0, places_.size(), places_[i], nearest);
        return std::sqrt(nearest.back());
    }

  private:
    using Nearest = std::array<double, kNeighbour + 1>;  ///< squared, the place itself first
    static constexpr size_t kLeaf = 8;

    void split(size_t begin, size_t end) {
        axis_.resize(std::max(axis_.size(), end));
        if (end - begin <= kLeaf) return;
        glm::dvec3 lo(1e300), hi(-1e300);
        for (size_t i = begin; i < end; ++i) {
            lo = glm::min(lo, places_[i]);
            hi = glm::max(hi, places_[i]);
        }
        const glm::dvec3 size = hi - lo;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const size_t middle = begin + (end - begin) / 2;
        std::nth_element(places_.begin() + static_cast<ptrdiff_t>(begin),
                         places_.begin() + static_cast<ptrdiff_t>(middle),
                         places_.begin() + static_cast<ptrdiff_t>(end),
                         [axis](const glm::dvec3& a, const glm::dvec3& b) { return a[axis] < b[axis]; });
        axis_[middle] = axis;
        split(begin, middle);
        split(middle, end);
    }
    void search(size_t begin, size_t end, const glm::dvec3& p, Nearest& nearest) const {
        if (end - begin <= kLeaf) {
            for (size_t i = begin; i < end; ++i) {
                const glm::dvec3 d = places_[i] - p;
                double square = glm::dot(d, d);
                for (double& n : nearest)
                    if (square < n) std::swap(square, n);
            }
            return;
        }
        const size_t middle = begin + (end - begin) / 2;
        const int axis = axis_[middle];
        const double off = p[axis] - places_[middle][axis];
        if (off < 0) {
            search(begin, middle, p, nearest);
            if (off * off <= nearest.back()) search(middle, end, p, nearest);
        } else {
            search(middle, end, p, nearest);
            if (off * off <= nearest.back()) search(begin, middle, p, nearest);
        }
    }
    std::vector<glm::dvec3>& places_;
    std::vector<int> axis_;  ///< of the split at a place
};

/// Places that only the last bits of their largest coordinate would tell apart are one: the pole of a ball computed by
/// sines is a hundred of them, 1e-16 radii from each other along the other axes.
void mergeRounded(std::vector<glm::dvec3>& places) {
    constexpr int kBits = 50;
    for (glm::dvec3& p : places) {
        const double most = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
        if (!(most > 1e-280) || !std::isfinite(most)) continue;
        const double step = std::ldexp(1.0, std::ilogb(most) - kBits);
        p = glm::round(p / step) * step;
    }
    const auto before = [](const glm::dvec3& a, const glm::dvec3& b) {
        return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
    };
    std::sort(places.begin(), places.end(), before);
    places.erase(std::unique(places.begin(), places.end()), places.end());
}

}  // namespace

double denseExtent(const std::vector<glm::dvec3>& places) {
    double extent = 0;
    for (int axis = 0; axis < 3 && !places.empty(); ++axis) {
        const Range range = rangeAlong(places, axis);
        extent = std::max(extent, range.high - range.low);
    }
    return extent;
}

double denseDistance(const std::vector<glm::dvec3>& places) {
    double distance = 0;
    for (int axis = 0; axis < 3 && !places.empty(); ++axis) {
        const Range range = rangeAlong(places, axis);
        distance = std::max({distance, std::abs(range.low), std::abs(range.high)});
    }
    return distance;
}

DenseBox denseBox(const std::vector<glm::dvec3>& places) {
    DenseBox box;
    if (places.empty()) return box;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> values;
        values.reserve(places.size());
        for (const glm::dvec3& p : places) values.push_back(p[axis]);
        box.middle[axis] = valueAt(values, 0.5);
    }
    const double reach = 2 * denseExtent(places);
    box.lo = box.hi = box.middle;
    for (const glm::dvec3& p : places) {
        const glm::dvec3 off = glm::abs(p - box.middle);
        if (std::max({off.x, off.y, off.z}) > reach) continue;
        box.lo = glm::min(box.lo, p);
        box.hi = glm::max(box.hi, p);
    }
    return box;
}

double denseSpacing(std::vector<glm::dvec3> places, double share) {
    constexpr double kDense = 0.01;
    mergeRounded(places);
    if (places.size() < kFewest) return 0;
    const PlaceTree tree(places);
    std::vector<double> distances(places.size());
    for (size_t i = 0; i < places.size(); ++i) distances[i] = tree.distanceOf(i);
    // pi d^2 holds four of them, and a sample is sparser than the whole.
    return valueAt(distances, kDense) * std::sqrt(3.14159265358979 / kNeighbour * share);
}

}  // namespace stipple::lod
