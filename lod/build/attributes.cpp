// Missing radii and normals, from each point's neighbourhood. The neighbourhood is that of its lattice cell: the finest
// cells with at most kCellPoints points, and their 26 neighbours of the same size (a size up while there are too few),
// so that it depends on the lattice alone, not on buckets, leaves or threads.
//
// Radius: 0.55 times the distance to the 12th neighbour: 1.07 spacings for randomly spread surface points, 0.87 to 1.1
// on regular grids; either closes the surface. Normal: the eigenvector of the smallest eigenvalue of the covariance of
// the 12 nearest, recentred, fp64 (hard cases 26 to 28). Its sign is unknown without the scanner's position: two-sided.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "lod/build/cloud.h"
#include "lod/build/morton.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kNeighbours = 12, kCellPoints = 8, kPointsPerNeighbourCell = 24, kLargestClimb = 6;
constexpr float kRadiusFactor = 0.7f, kLargestRadii = 4.0f, kStrayRadii = 4.0f;

struct Neighbourhood {
    std::vector<float> x, y, z;  ///< relative to the cell's first point, lattice units
    std::vector<float> squared;
    void clear() {
        x.clear();
        y.clear();
        z.clear();
    }
};

/// The value at `rank` (0: the least) of non-negative values: bisection on a threshold, each step one SIMD-friendly
/// count. Four times faster than nth_element on a hundred values.
float smallestAtRank(const std::vector<float>& values, size_t rank) {
    float lo = -1, hi = 0;
    for (const float v : values) hi = hi < v ? v : hi;
    // Invariant: at most `rank` values are <= lo, more than `rank` are <= hi.
    for (int step = 0; step < 40; ++step) {
        const float middle = 0.5f * (lo + hi);
        if (!(middle > lo && middle < hi)) break;
        uint32_t count = 0;
        for (const float v : values) count += v <= middle ? 1u : 0u;
        if (count > rank)
            hi = middle;
        else
            lo = middle;
        if (count == rank + 1) break;
    }
    float result = 0;  // the largest value <= hi
    for (const float v : values) result = v <= hi && v > result ? v : result;
    return result;
}

class Estimator {
  public:
    Estimator(Cloud& cloud, const Partition& partition, bool radii, bool normals)
        : cloud_(cloud), partition_(partition), radii_(radii), normals_(normals) {}

    void leaf(const BuildNode& node) { cell(node.begin, node.end, node.level); }

  private:
    void cell(uint32_t begin, uint32_t end, uint32_t level) {
        if (end - begin > kCellPoints && level < partition_.keyLevels) {
            const uint32_t shift = partition_.shiftOf(level + 1);
            for (uint32_t octant = 0; octant < 8 && begin < end; ++octant) {
                uint32_t split = begin;
                while (split < end && (partition_.key[split] >> shift & 7u) == octant) ++split;
                if (split > begin) cell(begin, split, level + 1);
                begin = split;
            }
            return;
        }
        gather(begin, level);
        for (uint32_t i = begin; i < end; ++i) point(i, begin);
    }

    void gather(uint32_t first, uint32_t level) {
        for (uint32_t climb = 0;; ++climb, --level) {
            hood_.clear();
            const uint32_t shift = partition_.shiftOf(level);
            const uint64_t code = partition_.key[first] >> shift;
            const auto cx = static_cast<int64_t>(compactBits(code)), cy = static_cast<int64_t>(compactBits(code >> 1)),
                       cz = static_cast<int64_t>(compactBits(code >> 2));
            const int64_t cells = int64_t{1} << level;
            for (int64_t z = std::max<int64_t>(cz - 1, 0); z <= std::min(cz + 1, cells - 1); ++z)
                for (int64_t y = std::max<int64_t>(cy - 1, 0); y <= std::min(cy + 1, cells - 1); ++y)
                    for (int64_t x = std::max<int64_t>(cx - 1, 0); x <= std::min(cx + 1, cells - 1); ++x)
                        append(first,
                               mortonCode(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z)),
                               shift);
            if (hood_.x.size() > kNeighbours || level == 0 || climb == kLargestClimb) return;
        }
    }

    /// Adds the points of one cell, thinned evenly where there are many.
    void append(uint32_t first, uint64_t code, uint32_t shift) {
        const auto& key = partition_.key;
        // Neighbours along the Morton curve are mostly near: gallop from `first` before bisecting.
        const uint64_t lo = code << shift, hi = (code + 1) << shift;
        const size_t begin = lowerBound(first, lo), end = lowerBound(begin < key.size() ? begin : first, hi);
        const size_t count = end - begin, stride = (count + kPointsPerNeighbourCell - 1) / kPointsPerNeighbourCell;
        const int64_t ox = cloud_.x[first], oy = cloud_.y[first], oz = cloud_.z[first];
        for (size_t i = begin; i < end; i += stride) {
            hood_.x.push_back(static_cast<float>(cloud_.x[i] - ox));
            hood_.y.push_back(static_cast<float>(cloud_.y[i] - oy));
            hood_.z.push_back(static_cast<float>(cloud_.z[i] - oz));
        }
    }

    size_t lowerBound(size_t from, uint64_t value) const {
        const auto& key = partition_.key;
        size_t lo = 0, hi = 0;
        if (key[from] < value) {
            size_t step = 1;
            lo = from + 1;
            while (from + step < key.size() && key[from + step] < value) {
                lo = from + step + 1;
                step *= 2;
            }
            hi = std::min(key.size(), from + step);
        } else {
            size_t step = 1;
            hi = from;
            while (step <= from && key[from - step] >= value) {
                hi = from - step;
                step *= 2;
            }
            lo = step <= from ? from - step + 1 : 0;
        }
        return static_cast<size_t>(std::lower_bound(key.begin() + static_cast<std::ptrdiff_t>(lo),
                                                    key.begin() + static_cast<std::ptrdiff_t>(hi), value) -
                                   key.begin());
    }

    void point(uint32_t i, uint32_t first) {
        const size_t n = hood_.x.size();
        const auto px = static_cast<float>(int64_t{cloud_.x[i]} - int64_t{cloud_.x[first]});
        const auto py = static_cast<float>(int64_t{cloud_.y[i]} - int64_t{cloud_.y[first]});
        const auto pz = static_cast<float>(int64_t{cloud_.z[i]} - int64_t{cloud_.z[first]});
        hood_.squared.resize(n);
        for (size_t k = 0; k < n; ++k) {
            const float dx = hood_.x[k] - px, dy = hood_.y[k] - py, dz = hood_.z[k] - pz;
            hood_.squared[k] = dx * dx + dy * dy + dz * dz;
        }
        float reach = 0;
        if (n > 1) {
            const size_t rank = std::min<size_t>(kNeighbours, n - 1);  // the point itself comes first
            reach = smallestAtRank(hood_.squared, rank);
        }
        if (radii_ && !(cloud_.radius[i] > 0)) cloud_.radius[i] = kRadiusFactor * std::sqrt(reach);
        if (normals_ && (cloud_.colour[i] >> 24 & shared::kFlagNoNormal) != 0) normal(i, reach);
    }

    void normal(uint32_t i, float reach) {
        Eigen::Vector3d mean = Eigen::Vector3d::Zero();
        size_t used = 0;
        for (size_t k = 0; k < hood_.x.size(); ++k) {
            if (hood_.squared[k] > reach) continue;
            mean += Eigen::Vector3d(hood_.x[k], hood_.y[k], hood_.z[k]);
            ++used;
        }
        if (used < 3) return;
        mean /= static_cast<double>(used);
        Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
        for (size_t k = 0; k < hood_.x.size(); ++k) {
            if (hood_.squared[k] > reach) continue;
            const Eigen::Vector3d d = Eigen::Vector3d(hood_.x[k], hood_.y[k], hood_.z[k]) - mean;
            covariance += d * d.transpose();
        }
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
        const Eigen::Vector3d& values = solver.eigenvalues();
        if (!(values[1] > 1e-6 * values[2])) return;  // a line or a point has no normal: it stays flagged
        const Eigen::Vector3d n = solver.eigenvectors().col(0);
        cloud_.normal[i] = octEncode(glm::vec3(n[0], n[1], n[2]));
        cloud_.colour[i] = (cloud_.colour[i] & 0xffffffu) | (shared::kFlagTwoSided | shared::kFlagEstimatedNormal)
                                                                << 24;
    }

    Cloud& cloud_;
    const Partition& partition_;
    bool radii_, normals_;
    Neighbourhood hood_;
};

/// Radii between half a lattice step and twice the leaf's median (hard case 23).
void clampRadii(Cloud& cloud, const BuildNode& leaf) {
    std::vector<float> radii(cloud.radius.begin() + leaf.begin, cloud.radius.begin() + leaf.end);
    const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
    std::nth_element(radii.begin(), middle, radii.end());
    const float limit = std::max(kLargestRadii * *middle, 1.0f);
    for (uint32_t i = leaf.begin; i < leaf.end; ++i) cloud.radius[i] = std::clamp(cloud.radius[i], 0.5f, limit);
}

/// Stray points of a scan have their neighbours far away, whole leaves of them: no leaf knows. Against the whole cloud
/// they show: nothing gets a radius beyond kStrayRadii times what 95 of 100 points stay below.
void clampStrays(Cloud& cloud) {
    std::vector<float> sample;
    const size_t stride = cloud.size() / 65536 + 1;
    for (size_t i = 0; i < cloud.size(); i += stride) sample.push_back(cloud.radius[i]);
    const auto at = sample.begin() + static_cast<std::ptrdiff_t>((sample.size() - 1) * 95 / 100);
    std::nth_element(sample.begin(), at, sample.end());
    const float limit = std::max(kStrayRadii * *at, 0.5f);
    for (float& r : cloud.radius) r = std::min(r, limit);
}

}  // namespace

void estimateAttributes(Cloud& cloud, const Partition& partition, const BuildSettings& settings, Executor& executor,
                        Progress& progress) {
    const bool radii = settings.estimateRadii, normals = settings.normals == NormalsMode::automatic;
    std::atomic<uint64_t> done{0};
    executor.parallelFor(partition.nodes.size(), 1, [&](size_t begin, size_t end) {
        Estimator estimator(cloud, partition, radii, normals);
        for (size_t i = begin; i < end; ++i) {
            const BuildNode& node = partition.nodes[i];
            if (node.childMask != 0) continue;
            estimator.leaf(node);
            clampRadii(cloud, node);
            done += node.end - node.begin;
        }
        progress.update("attributes", done.load(), cloud.size());
    });
    if (radii && !cloud.hasRadius) clampStrays(cloud);
}

}  // namespace stipple::lod
