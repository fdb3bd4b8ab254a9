#include <Eigen/Eigenvalues>
#include <algorithm>
#include <numeric>

#include "lod/builder/patches/cone.h"
#include "lod/builder/patches/segments.h"

namespace stipple::lod {
namespace {

class Unions {
  public:
    explicit Unions(size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
    uint32_t find(uint32_t i) {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    /// The smaller index stands for both.
    void join(uint32_t a, uint32_t b) {
        a = find(a);
        b = find(b);
        parent_[std::max(a, b)] = std::min(a, b);
    }

  private:
    std::vector<uint32_t> parent_;
};

glm::dvec3 longestAxis(const SurfaceElements& elements, const Segment& segment) {
    glm::dvec3 mean(0);
    for (const uint32_t i : segment) mean += elements.centre[i];
    mean /= static_cast<double>(segment.size());
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const uint32_t i : segment) {
        const glm::dvec3 d = elements.centre[i] - mean;
        const Eigen::Vector3d v(d.x, d.y, d.z);
        sum += v * v.transpose();
    }
    const double trace = sum.trace();
    if (!(trace > 0)) return {1, 0, 0};
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(sum / trace);
    const Eigen::Vector3d v = solver.eigenvectors().col(2);
    return {v[0], v[1], v[2]};
}

bool isNarrow(const SurfaceElements& elements, const Segment& segment, double cosine) {
    glm::dvec3 mean(0);
    for (const uint32_t i : segment) mean += glm::dvec3(elements.normal[i]);
    const double length = glm::length(mean);
    if (length > 1e-6) {  // the mean is an axis that often does
        mean /= length;
        double least = 1;
        for (const uint32_t i : segment) least = std::min(least, glm::dot(glm::dvec3(elements.normal[i]), mean));
        if (least >= cosine) return true;
    }
    return coneOf(elements.normal, segment, cosine).cosine >= cosine;
}

}  // namespace

std::vector<Segment> connectedComponents(const SurfaceElements& elements) {
    Unions unions(elements.size());
    for (uint32_t i = 0; i < elements.size(); ++i)
        for (const uint32_t k : elements.links(i)) unions.join(i, k);
    std::vector<uint32_t> number(elements.size(), ~0u);
    std::vector<Segment> out;
    for (uint32_t i = 0; i < elements.size(); ++i) {
        const uint32_t first = unions.find(i);
        if (number[first] == ~0u) {
            number[first] = static_cast<uint32_t>(out.size());
            out.emplace_back();
        }
        out[number[first]].push_back(i);
    }
    return out;
}

std::pair<Segment, Segment> halves(const SurfaceElements& elements, const Segment& segment) {
    const glm::dvec3 axis = longestAxis(elements, segment);
    std::vector<std::pair<double, uint32_t>> along;
    along.reserve(segment.size());
    for (const uint32_t i : segment) along.emplace_back(glm::dot(elements.centre[i], axis), i);
    const auto middle = along.begin() + static_cast<ptrdiff_t>(along.size() / 2);
    std::nth_element(along.begin(), middle, along.end());
    std::pair<Segment, Segment> out;
    for (auto k = along.begin(); k != along.end(); ++k) (k < middle ? out.first : out.second).push_back(k->second);
    std::sort(out.first.begin(), out.first.end());
    std::sort(out.second.begin(), out.second.end());
    return out;
}

std::vector<Segment> splitByCone(const SurfaceElements& elements, std::vector<Segment> segments,
                                 const SegmentSettings& settings, Executor& executor) {
    std::vector<Segment> done;
    while (!segments.empty()) {
        if (settings.isStopped && settings.isStopped()) return {};
        std::vector<std::pair<Segment, Segment>> parts(segments.size());
        executor.parallelFor(segments.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k)
                if (segments[k].size() > 1 && !isNarrow(elements, segments[k], settings.coneCosine))
                    parts[k] = halves(elements, segments[k]);
        });
        std::vector<Segment> next;
        for (size_t k = 0; k < segments.size(); ++k) {
            if (parts[k].first.empty()) {
                done.push_back(std::move(segments[k]));
            } else {
                next.push_back(std::move(parts[k].first));
                next.push_back(std::move(parts[k].second));
            }
        }
        segments = std::move(next);
    }
    std::sort(done.begin(), done.end(), [](const Segment& a, const Segment& b) { return a.front() < b.front(); });
    return done;
}

std::vector<uint8_t> costliest(const std::vector<PatchCost>& costs, double left, double most) {
    double sum = left;
    std::vector<size_t> order;
    for (const PatchCost& c : costs) {
        order.push_back(order.size());
        sum += c.samples;
    }
    std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
        const double x = costs[a].samples * costs[b].records, y = costs[b].samples * costs[a].records;
        return x != y ? x > y : a < b;
    });
    std::vector<uint8_t> isLeft(costs.size(), 0);
    for (const size_t k : order) {
        if (sum <= most || costs[k].samples <= 2 * costs[k].records) break;
        sum += costs[k].records - costs[k].samples;
        isLeft[k] = 1;
    }
    return isLeft;
}

}  // namespace stipple::lod
