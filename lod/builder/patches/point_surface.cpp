#include "lod/builder/patches/point_surface.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numeric>
#include <tuple>

#include "engine/base/numbers.h"
#include "lod/builder/morton.h"

namespace stipple::lod {
namespace {

constexpr size_t kNeighbours = 16, kLinks = 8;
constexpr double kThick = 0.25;   ///< least variance over the middle one: no surface
constexpr double kThin = 0.02;    ///< middle variance over the first: a line
constexpr double kRoom = 1.0001;  ///< of limits, for the rounding of coordinates
constexpr double kFarLink = 3;    ///< spacings of the other point

/// Finite points in Morton order, none at the place of another. Equal ones hang on what else they hold.
void orderPoints(PointBlock& from, PointSurface& s) {
    s.points = from.position.size();
    glm::dvec3 lo(std::numeric_limits<double>::max()), hi(std::numeric_limits<double>::lowest());
    std::vector<std::pair<uint64_t, uint32_t>> order;
    for (const glm::dvec3& p : from.position)
        if (isFinite(p)) {
            lo = glm::min(lo, p);
            hi = glm::max(hi, p);
        }
    if (lo.x <= hi.x) s.middle = 0.5 * lo + 0.5 * hi;
    const double extent = std::max({0.0, hi.x - s.middle.x, hi.y - s.middle.y, hi.z - s.middle.z});
    const double scale = extent > 0 ? 2097151.0 / (2 * extent) : 0;
    for (uint32_t i = 0; i < from.position.size(); ++i) {
        if (!isFinite(from.position[i])) continue;
        const auto along = [&](int a) {
            return toWhole<uint64_t>((from.position[i][a] - s.middle[a] + extent) * scale);
        };
        order.emplace_back(shortMortonCode(along(0), along(1), along(2)), i);
    }
    if (const uint64_t bad = s.points - order.size(); bad > 0) s.dropped["not finite"] = bad;
    const auto place = [&](uint32_t i) {
        const glm::dvec3& p = from.position[i];
        return std::tie(p.x, p.y, p.z);
    };
    const auto look = [&](uint32_t i) {
        const glm::vec3 n = from.normal.empty() ? glm::vec3(0) : from.normal[i];
        return std::tuple(from.colour.empty() ? 0u : from.colour[i], n.x, n.y, n.z);
    };
    std::sort(order.begin(), order.end(), [&](const auto& a, const auto& b) {
        if (a.first != b.first) return a.first < b.first;
        return place(a.second) != place(b.second) ? place(a.second) < place(b.second) : look(a.second) < look(b.second);
    });
    for (size_t k = 0; k < order.size(); ++k) {
        const uint32_t i = order[k].second;
        if (k > 0 && place(i) == place(order[k - 1].second)) {
            ++s.dropped["at the place of another"];
            continue;
        }
        s.elements.centre.push_back(from.position[i] - s.middle);
        if (!from.colour.empty()) s.colour.push_back(from.colour[i] & 0xffffffu);
        if (!from.normal.empty()) s.given.push_back(from.normal[i]);
    }
    from = {};
}

/// The nearest of points one after another: those of one are that many for another, too, so none of that one's is
/// farther than they are from one and the way between both. What that bounds well is looked for together.
class NearestOf {
  public:
    explicit NearestOf(const PointSurface& s) : s_(s) {}

    /// Of point i, itself the first; the points up to `end` come next.
    const NearPoints::Found& find(size_t i, size_t end) {
        if (i >= ahead_) lookAhead(i, end);
        if (i < ahead_) {
            const float limit = std::min(limitFrom(i, known_, ofKnown_), limitFrom(i, before_, reach()));
            s_.near.find(runs_, s_.elements.centre[i], kMost, limit, near_);
        } else {
            const bool isBounded = near_.count == kMost;
            const float limit = isBounded ? limitFrom(i, before_, reach()) : std::numeric_limits<float>::max();
            s_.near.find(s_.elements.centre[i], kMost, limit, near_);
        }
        before_ = i;
        return near_;
    }

  private:
    static constexpr size_t kMost = kNeighbours + 1, kAhead = 16;
    static constexpr double kClose = 0.8;  ///< of the farthest neighbour's distance, that the next points are away

    double way(size_t i, size_t k) const { return glm::distance(s_.elements.centre[i], s_.elements.centre[k]); }
    double reach() const { return std::sqrt(static_cast<double>(near_.squared[kMost - 1])); }
    float limitFrom(size_t i, size_t known, double reach) const {
        const double most = way(i, known) + reach;
        return toFloat(most * most * kRoom);
    }
    /// Where the point before is near enough to the next ones.
    void lookAhead(size_t i, size_t end) {
        ahead_ = i;
        if (near_.count != kMost) return;
        known_ = before_;
        ofKnown_ = reach();
        const double close = kClose * ofKnown_;
        glm::dvec3 lo(std::numeric_limits<double>::max()), hi(std::numeric_limits<double>::lowest());
        float limit = 0;
        for (; ahead_ < std::min(i + kAhead, end) && way(ahead_, known_) <= close; ++ahead_) {
            lo = glm::min(lo, s_.elements.centre[ahead_]);
            hi = glm::max(hi, s_.elements.centre[ahead_]);
            limit = std::max(limit, limitFrom(ahead_, known_, ofKnown_));
        }
        if (ahead_ > i) s_.near.runsNear(lo, hi, limit, runs_);
    }

    const PointSurface& s_;
    NearPoints::Found near_;
    NearPoints::Runs runs_;
    size_t before_ = 0, ahead_ = 0, known_ = 0;
    double ofKnown_ = 0;  ///< the farthest of the neighbours of the one that is known
};

/// Normal, spacing and noise of a point (`near`: of it, itself the first); is it one of a surface?
bool describe(const NearPoints::Found& near, size_t i, PointSurface& s) {
    const size_t n = near.count, last = n == 0 ? 0 : std::min(n, kLinks + 1) - 1;
    const double area =
        last > 0 ? 3.14159265358979323846 * static_cast<double>(near.squared[last]) / static_cast<double>(last) : 0;
    s.elements.area[i] = area;
    s.spacing[i] = toFloat(std::sqrt(area));
    s.elements.normal[i] = {0, 0, 1};
    if (n < 4) return false;
    glm::dvec3 mean(0), xx(0), xy(0);  // squares; products of x and y, y and z, z and x
    for (size_t k = 0; k < n; ++k) {
        const glm::dvec3 d = s.elements.centre[near.index[k]] - s.elements.centre[i];
        mean += d;
        xx += d * d;
        xy += d * glm::dvec3(d.y, d.z, d.x);
    }
    mean /= static_cast<double>(n);
    xx -= static_cast<double>(n) * mean * mean;
    xy -= static_cast<double>(n) * mean * glm::dvec3(mean.y, mean.z, mean.x);
    Eigen::Matrix3d sum;
    sum << xx.x, xy.x, xy.z, xy.x, xx.y, xy.y, xy.z, xy.y, xx.z;
    const double trace = sum.trace();
    if (!(trace > 0) || !std::isfinite(trace)) return false;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(sum / trace);
    const Eigen::Vector3d& v = solver.eigenvalues();
    const Eigen::Vector3d e = solver.eigenvectors().col(0);
    if (!std::isfinite(e.sum()) || !(e.norm() > 0.5)) return false;
    s.elements.normal[i] = glm::normalize(glm::vec3(e[0], e[1], e[2]));
    const double least = std::max(v[0], 0.0);
    s.noise[i] = toFloat(std::sqrt(least * trace / static_cast<double>(n)));
    return least <= kThick * v[1] && v[1] >= kThin * v[2];
}

}  // namespace

PointSurface pointSurface(PointBlock points, const std::function<bool()>& isStopped, Executor& executor,
                          Progress& progress) {
    PointSurface s;
    orderPoints(points, s);
    const size_t count = s.elements.centre.size();
    s.elements.normal.resize(count);
    s.elements.area.resize(count);
    s.spacing.resize(count);
    s.noise.assign(count, 0);
    s.isSurface.assign(count, 0);
    s.near = NearPoints(s.elements.centre);
    std::vector<std::array<uint32_t, kLinks>> beside(count);
    std::atomic<uint64_t> done{0};
    executor.parallelFor(count, 4096, [&](size_t begin, size_t end) {
        if (isStopped && isStopped()) return;
        NearestOf nearest(s);
        for (size_t i = begin; i < end; ++i) {
            const NearPoints::Found& near = nearest.find(i, end);
            s.isSurface[i] = describe(near, i, s) ? 1 : 0;
            beside[i].fill(static_cast<uint32_t>(i));
            for (size_t k = 1; k < std::min(near.count, kLinks + 1); ++k) beside[i][k - 1] = near.index[k];
        }
        progress.update("normals", done += end - begin, count);
    });
    if (isStopped && isStopped()) return s;
    std::vector<std::pair<uint32_t, uint32_t>> pairs;
    for (uint32_t i = 0; i < count; ++i)
        for (const uint32_t k : beside[i]) {
            if (k == i || s.isSurface[i] == 0 || s.isSurface[k] == 0) continue;
            const double far = kFarLink * static_cast<double>(s.spacing[k]);
            if (glm::distance(s.elements.centre[i], s.elements.centre[k]) <= far) pairs.emplace_back(i, k);
        }
    setLinks(std::move(pairs), s.elements);
    bool isGiven = !s.given.empty();
    for (size_t i = 0; i < s.given.size() && isGiven; ++i) isGiven = hasDirection(s.given[i]);
    if (isGiven) {
        for (size_t i = 0; i < count; ++i)
            if (glm::dot(withoutScale(s.given[i]), s.elements.normal[i]) < 0)
                s.elements.normal[i] = -s.elements.normal[i];
    } else {
        agreeOnSides(s.elements);
    }
    return s;
}

void agreeOnSides(SurfaceElements& e) {
    constexpr uint32_t kBuckets = 256;
    std::vector<uint32_t> byHeight(e.size());
    std::iota(byHeight.begin(), byHeight.end(), 0u);
    std::stable_sort(byHeight.begin(), byHeight.end(),
                     [&](uint32_t a, uint32_t b) { return e.centre[a].z > e.centre[b].z; });
    std::vector<uint8_t> isDone(e.size(), 0);
    std::array<std::vector<std::pair<uint32_t, uint32_t>>, kBuckets> waiting;  // from, to
    for (const uint32_t highest : byHeight) {
        if (isDone[highest] != 0) continue;
        if (e.normal[highest].z < 0) e.normal[highest] = -e.normal[highest];
        isDone[highest] = 1;
        uint32_t lowest = kBuckets;
        const auto offer = [&](uint32_t from) {
            for (const uint32_t to : e.links(from)) {
                if (isDone[to] != 0) continue;
                const float bend = 1 - std::abs(glm::dot(e.normal[from], e.normal[to]));
                const uint32_t bucket = std::min(toWhole<uint32_t>(bend * static_cast<float>(kBuckets)), kBuckets - 1);
                waiting.at(bucket).emplace_back(from, to);
                lowest = std::min(lowest, bucket);
            }
        };
        offer(highest);
        while (lowest < kBuckets) {
            auto& bucket = waiting.at(lowest);
            if (bucket.empty()) {
                ++lowest;
                continue;
            }
            const auto [from, to] = bucket.back();
            bucket.pop_back();
            if (isDone[to] != 0) continue;
            isDone[to] = 1;
            if (glm::dot(e.normal[from], e.normal[to]) < 0) e.normal[to] = -e.normal[to];
            offer(to);
        }
    }
}

}  // namespace stipple::lod
