#include <algorithm>
#include <cmath>
#include <queue>
#include <tuple>
#include <unordered_set>

#include "lod/builder/patches/cone.h"
#include "lod/builder/patches/segments.h"

namespace stipple::lod {
namespace {

constexpr double kAreaUnits = 1099511627776.0;  ///< 2^40 to the area of all: sums of integers hang on no order
constexpr size_t kFew = 2048;                   ///< normals that may be looked at again and again
constexpr size_t kAlike = 8;                    ///< or if the smaller side is at least that share of the larger

struct Part {
    Segment elements;
    NormalCone cone;
    int64_t area = 0;
    std::array<int64_t, 3> sum{};  ///< of area * normal
    /// Sum of area |n - m|^2 with the mean direction m of its normals: 2 (area - |sum|).
    static double errorOf(int64_t area, const std::array<int64_t, 3>& sum) {
        const glm::dvec3 s(static_cast<double>(sum[0]), static_cast<double>(sum[1]), static_cast<double>(sum[2]));
        return 2 * (static_cast<double>(area) - glm::length(s));
    }
};

struct Candidate {
    int64_t rise;  ///< of the error
    uint32_t a, b;
    bool operator<(const Candidate& o) const {  // a heap has the largest on top
        return std::tie(rise, a, b) > std::tie(o.rise, o.a, o.b);
    }
};

class Merger {
  public:
    Merger(const SurfaceElements& elements, std::vector<Segment> segments, const SegmentSettings& settings)
        : elements_(elements), settings_(settings), parts_(segments.size()) {
        double all = 0;
        for (const Segment& s : segments)
            for (const uint32_t i : s) all += elements.area[i];
        const double unit = all > 0 ? kAreaUnits / all : 0;
        for (size_t k = 0; k < segments.size(); ++k) describe(std::move(segments[k]), unit, parts_[k]);
        into_.resize(parts_.size());
        for (uint32_t k = 0; k < parts_.size(); ++k) into_[k] = k;
    }

    /// Neighbours are told apart once, as they are at first; what has been merged since is found when a candidate comes
    /// up, and waits again if it rises more by then. What does not fit never will: cones only grow.
    std::vector<Segment> run() {
        offerNeighbours();
        for (size_t steps = 0; !queue_.empty(); ++steps) {
            if (steps % 4096 == 0 && settings_.isStopped && settings_.isStopped()) return {};
            const Candidate first = queue_.top();
            queue_.pop();
            const Candidate c = candidate(find(first.a), find(first.b));
            const uint64_t pair = uint64_t{c.a} << 32 | c.b;
            if (c.a == c.b || apart_.contains(pair)) continue;
            if (c.rise > first.rise) {
                queue_.push(c);
                continue;
            }
            NormalCone cone;
            if (fit(parts_[c.a], parts_[c.b], cone))
                merge(c.a, c.b, cone);
            else
                apart_.insert(pair);
        }
        std::vector<Segment> out;
        for (Part& p : parts_)
            if (!p.elements.empty()) out.push_back(std::move(p.elements));
        for (Segment& s : out) std::sort(s.begin(), s.end());
        std::sort(out.begin(), out.end(), [](const Segment& a, const Segment& b) { return a.front() < b.front(); });
        return out;
    }

  private:
    void describe(Segment segment, double unit, Part& part) const {
        part.elements = std::move(segment);
        part.cone = coneOf(elements_.normal, part.elements);
        for (const uint32_t i : part.elements) {
            const double area = elements_.area[i] * unit;
            part.area += std::llround(area);
            for (int a = 0; a < 3; ++a)
                part.sum.at(static_cast<size_t>(a)) += std::llround(area * static_cast<double>(elements_.normal[i][a]));
        }
    }

    void offerNeighbours() {
        std::vector<uint32_t> owner(elements_.size(), ~0u);
        for (uint32_t k = 0; k < parts_.size(); ++k)
            for (const uint32_t i : parts_[k].elements) owner[i] = k;
        std::vector<uint32_t> beside;
        for (uint32_t k = 0; k < parts_.size(); ++k) {
            beside.clear();
            for (const uint32_t i : parts_[k].elements)
                for (const uint32_t j : elements_.links(i))
                    if (owner[j] != ~0u && owner[j] > k) beside.push_back(owner[j]);
            std::sort(beside.begin(), beside.end());
            beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
            for (const uint32_t other : beside) queue_.push(candidate(k, other));
        }
    }

    Candidate candidate(uint32_t a, uint32_t b) const {
        if (a > b) std::swap(a, b);
        const Part &p = parts_[a], &q = parts_[b];
        std::array<int64_t, 3> sum{};
        for (size_t k = 0; k < 3; ++k) sum.at(k) = p.sum.at(k) + q.sum.at(k);
        const double rise =
            Part::errorOf(p.area + q.area, sum) - Part::errorOf(p.area, p.sum) - Part::errorOf(q.area, q.sum);
        return {std::llround(rise), a, b};
    }

    /// Into the first's cone, or the second's, or one about both, or, where it is worth looking, the smallest of all.
    bool fit(const Part& p, const Part& q, NormalCone& cone) const {
        if (p.elements.size() + q.elements.size() > settings_.mostElements) return false;
        if (!mayFit(p.cone, q.cone, settings_.coneCosine, cone)) return false;
        const bool isSure = cone.cosine >= settings_.coneCosine;
        const size_t small = std::min(p.elements.size(), q.elements.size()),
                     large = std::max(p.elements.size(), q.elements.size());
        if (isSure && small * kAlike < large && large > kFew) {
            // A cone that holds both; its own rim is not known: those of both hold for what is to exclude others.
            cone.supports = 0;
            const NormalCone& wider = p.cone.cosine < q.cone.cosine ? p.cone : q.cone;
            for (uint32_t k = 0; k < wider.supports; ++k) cone.support.at(cone.supports++) = wider.support.at(k);
            return true;
        }
        if (!isSure && small * kAlike < large && large > kFew) return holds(p, q, cone);
        Segment both = p.elements;
        both.insert(both.end(), q.elements.begin(), q.elements.end());
        std::sort(both.begin(), both.end());
        cone = coneOf(elements_.normal, both, settings_.coneCosine);
        return cone.cosine >= settings_.coneCosine;
    }
    /// Do the normals of the smaller part lie in a cone about the axis of the larger?
    bool holds(const Part& p, const Part& q, NormalCone& cone) const {
        const Part &large = p.elements.size() >= q.elements.size() ? p : q, &small = &large == &p ? q : p;
        cone = large.cone;
        for (const uint32_t i : small.elements)
            cone.cosine = std::min(cone.cosine, glm::dot(glm::dvec3(elements_.normal[i]), cone.axis));
        return cone.cosine >= settings_.coneCosine;
    }

    uint32_t find(uint32_t k) {
        while (into_[k] != k) k = into_[k] = into_[into_[k]];
        return k;
    }

    void merge(uint32_t a, uint32_t b, const NormalCone& cone) {
        if (parts_[a].elements.size() < parts_[b].elements.size()) std::swap(a, b);
        Part &p = parts_[a], &q = parts_[b];
        p.elements.insert(p.elements.end(), q.elements.begin(), q.elements.end());
        p.cone = cone;
        p.area += q.area;
        for (size_t k = 0; k < 3; ++k) p.sum.at(k) += q.sum.at(k);
        into_[b] = a;
        q.elements = {};
    }

    const SurfaceElements& elements_;
    const SegmentSettings& settings_;
    std::vector<Part> parts_;
    std::vector<uint32_t> into_;  ///< what a part was merged into
    std::priority_queue<Candidate> queue_;
    std::unordered_set<uint64_t> apart_;  ///< pairs that do not fit
};

}  // namespace

std::vector<Segment> mergeByNormals(const SurfaceElements& elements, std::vector<Segment> segments,
                                    const SegmentSettings& settings) {
    return Merger(elements, std::move(segments), settings).run();
}

}  // namespace stipple::lod
