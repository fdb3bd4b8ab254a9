#include "engine/scene/borders.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <unordered_map>

#include "engine/scene/scene.h"

namespace stipple::scene {
namespace {

constexpr double kReach = 4;          ///< spacings of the points
constexpr double kCellsAcross = 512;  ///< of the grid that measures the spacing
constexpr int kMostPerEdge = 4096;    ///< samples of one edge

using Place = std::array<double, 3>;
Place placeOf(const glm::dvec3& p) { return {p.x + 0.0, p.y + 0.0, p.z + 0.0}; }  // -0 is 0

/// Points by cell of a grid.
class Grid {
  public:
    Grid(const std::vector<glm::dvec3>& points, double cell) : cell_(cell) {
        for (const glm::dvec3& p : points) cells_[keyOf(cellOf(p))].push_back(p);
    }
    size_t cells() const { return cells_.size(); }
    /// Is a point within a cell's size of p?
    bool isNear(const glm::dvec3& p) const {
        const glm::i64vec3 c = cellOf(p);
        for (int k = 0; k < 27; ++k) {
            const auto at = cells_.find(keyOf(c + glm::i64vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
            if (at == cells_.end()) continue;
            for (const glm::dvec3& q : at->second)
                if (glm::length(p - q) <= cell_) return true;
        }
        return false;
    }

  private:
    glm::i64vec3 cellOf(const glm::dvec3& p) const {
        constexpr double kFarthest = 0x1p62;  // of those beside it, too, integers hold the numbers
        return glm::i64vec3(glm::clamp(glm::floor(p / cell_), -kFarthest, kFarthest));
    }
    static uint64_t keyOf(const glm::i64vec3& c) {  // 21 bits an axis; what wraps round costs a test of distance
        constexpr int64_t kMask = (1 << 21) - 1;
        return static_cast<uint64_t>((c.x & kMask) << 42 | (c.y & kMask) << 21 | (c.z & kMask));
    }
    double cell_;
    std::unordered_map<uint64_t, std::vector<glm::dvec3>> cells_;
};

struct Edge {
    Place a, b;  ///< the lesser place first
    size_t triangle = 0;
    int from = 0;  ///< corner that the edge begins at
};

std::vector<Edge> openEdges(const std::vector<std::array<glm::dvec3, 3>>& corners) {
    std::vector<Edge> edges;
    edges.reserve(3 * corners.size());
    for (size_t t = 0; t < corners.size(); ++t)
        for (int k = 0; k < 3; ++k) {
            Edge e{placeOf(corners[t][static_cast<size_t>(k)]), placeOf(corners[t][static_cast<size_t>((k + 1) % 3)]),
                   t, k};
            if (e.a == e.b) continue;
            if (e.b < e.a) std::swap(e.a, e.b);
            edges.push_back(e);
        }
    const auto isLess = [](const Edge& p, const Edge& q) {
        return std::tie(p.a, p.b, p.triangle, p.from) < std::tie(q.a, q.b, q.triangle, q.from);
    };
    std::sort(edges.begin(), edges.end(), isLess);
    std::vector<Edge> open;
    for (size_t i = 0; i < edges.size();) {
        size_t end = i + 1;
        while (end < edges.size() && edges[end].a == edges[i].a && edges[end].b == edges[i].b) ++end;
        if (end == i + 1) open.push_back(edges[i]);
        i = end;
    }
    return open;
}

/// Mean distance of neighbours, as of points spread over a surface.
double spacingOf(const std::vector<glm::dvec3>& points) {
    Box box;
    for (const glm::dvec3& p : points) box.add(p);
    const glm::dvec3 size = box.greatest - box.least;
    double cell = std::max({size.x, size.y, size.z}) / kCellsAcross;
    if (!(cell > 0) || !std::isfinite(cell)) return 0;
    for (int octave = 0; octave < 9; ++octave, cell *= 2) {
        const double each = static_cast<double>(points.size()) / static_cast<double>(Grid(points, cell).cells());
        if (each >= 4) return cell / std::sqrt(each);
    }
    return cell;
}

}  // namespace

std::vector<BorderSample> borderSamples(const std::vector<std::array<glm::dvec3, 3>>& corners,
                                        const std::vector<glm::dvec3>& points) {
    std::vector<BorderSample> samples;
    const std::vector<Edge> open = openEdges(corners);
    if (open.empty() || points.empty()) return samples;
    const double spacing = spacingOf(points);
    if (!(spacing > 0)) return samples;
    const Grid grid(points, kReach * spacing);
    for (const Edge& e : open) {
        const auto from = static_cast<size_t>(e.from), to = (from + 1) % 3;
        const glm::dvec3 a = corners[e.triangle].at(from), b = corners[e.triangle].at(to);
        const double wanted = std::ceil(glm::length(b - a) / spacing);
        if (!std::isfinite(wanted)) continue;
        const int count = static_cast<int>(std::clamp(wanted, 1.0, double{kMostPerEdge}));
        for (int s = 0; s < count; ++s) {
            const double t = (s + 0.5) / count;
            if (!grid.isNear(a + t * (b - a))) continue;
            BorderSample sample{e.triangle, glm::dvec3(0)};
            sample.weight[static_cast<int>(from)] = 1 - t;
            sample.weight[static_cast<int>(to)] = t;
            samples.push_back(sample);
        }
    }
    return samples;
}

}  // namespace stipple::scene
