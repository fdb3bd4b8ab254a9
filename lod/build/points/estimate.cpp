// A block is an octree cell of at most kBlockPoints points, a quarter of its counted cell at most. It is split evenly
// into window cells of two to eight points (if they lie on a surface). What is estimated at the points of a window cell
// comes from it and its 26 neighbours:
//   radius  1.37 spacings, from the distance d of a point's 12th neighbour there: pi d^2 holds 12 of them
//   normal  the direction of least variance (Hoppe et al. 1992), sign unknown: two-sided. Of all points of the window,
//           the same for all points of the cell; or, fine, of each point's own twelve nearest.
// A point that stands alone, away from what its neighbours belong to, has the disc of those: of twice their spacing at
// most (spacingOfOthers).
// With fewer points in the window it grows, up to the quarter of a counted cell that buckets know of their neighbours
// (Distributor); then what is there must do. All of this hangs on the lattice and on counts alone.
#include "lod/build/points/estimate.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>

#include "lod/build/points/select.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr size_t kBlockPoints = 2048, kNeighbours = 12;
constexpr uint32_t kMostSplits = 5, kMostInThree = 128;
constexpr float kSpacings = 1.368f;
constexpr double kLargestSpacings = 3;
constexpr size_t kSparse = 2;        ///< points of a window cell, or fewer, that may stand alone
constexpr size_t kCompanions = 3;    ///< at least that many of twelve neighbours are near by, or a point stands alone:
constexpr float kNear2 = 0.5f;       ///< squared, of the distance of the twelfth (on a surface: 1/4)
constexpr size_t kOfOthers = 4;      ///< rank of the neighbour that tells the spacing of others
constexpr float kAloneSpacings = 2;  ///< how much wider than of its neighbours the disc of such a point may be
constexpr double kFlat = 1e-6;       ///< a line or a point has no normal: second variance over the first

/// Count, sums and sums of products.
struct Moments {
    float n, x, y, z, xx, xy, xz, yy, yz, zz;
    void add(float px, float py, float pz) {
        n += 1;
        x += px;
        y += py;
        z += pz;
        xx += px * px;
        xy += px * py;
        xz += px * pz;
        yy += py * py;
        yz += py * pz;
        zz += pz * pz;
    }
};

constexpr uint32_t kNoNormal = ~0u;  ///< no octahedral code

/// The direction of least variance, octahedral; kNoNormal where there is none.
uint32_t normalFrom(const Moments& m) {
    if (m.n < 3) return kNoNormal;
    const double scale = 1.0 / static_cast<double>(m.n), x = m.x * scale, y = m.y * scale, z = m.z * scale;
    Eigen::Matrix3d c;
    c(0, 0) = m.xx * scale - x * x;
    c(1, 0) = m.xy * scale - x * y;
    c(2, 0) = m.xz * scale - x * z;
    c(1, 1) = m.yy * scale - y * y;
    c(2, 1) = m.yz * scale - y * z;
    c(2, 2) = m.zz * scale - z * z;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(c);
    const Eigen::Vector3d& v = solver.eigenvalues();
    if (!(v[1] > kFlat * v[2])) return kNoNormal;
    const Eigen::Vector3d n = solver.eigenvectors().col(0);
    const glm::vec3 normal(n[0], n[1], n[2]);
    return std::isfinite(normal.x + normal.y + normal.z) && normal != glm::vec3(0) ? roundedNormal(normal) : kNoNormal;
}

/// Lattice box, both ends inside.
struct LatticeBox {
    std::array<int64_t, 3> lo{}, hi{};
    bool holds(int64_t x, int64_t y, int64_t z) const {
        return x >= lo[0] && x <= hi[0] && y >= lo[1] && y <= hi[1] && z >= lo[2] && z <= hi[2];
    }
    LatticeBox grown(int64_t by) const {
        LatticeBox b = *this;
        for (size_t a = 0; a < 3; ++a) {
            b.lo[a] -= by;
            b.hi[a] += by;
        }
        return b;
    }
};

/// K: Key, or uint64_t where that holds all keys, which is most often and faster.
template <typename K>
class Estimator {
  public:
    Estimator(const Frame& frame, const CellTree& tree, const EstimateSettings& settings, const Places& ghosts,
              SortedPoints& own)
        : frame_(frame),
          tree_(tree),
          settings_(settings),
          ghosts_(ghosts),
          own_(own),
          keys_(own.key.begin(), own.key.end()),
          ghostKeys_(ghosts.key.begin(), ghosts.key.end()) {}

    void cell(uint32_t index) {
        const Cell& c = tree_.cells()[index];
        cell_ = c;
        cellShift_ = frame_.shiftOf(c.level);
        cellBox_ = boxOf(static_cast<K>(c.key), c.level);
        reach_ = static_cast<int64_t>(frame_.cellSize(c.level)) / 4;
        const auto [begin, end] = rangeOf(keys_, static_cast<K>(c.key), cellShift_);
        if (begin == end) return;
        blocks(begin, end, c.level, std::min<uint32_t>(c.level + 2u, frame_.keyLevels));
    }

  private:
    /// Of the cell of `level` that holds `place`.
    LatticeBox boxOf(K place, uint32_t level) const {
        const uint32_t drop = frame_.rootLog2 - frame_.keyLevels, shift = frame_.shiftOf(level);
        const K key = place >> shift << shift;
        const auto size = static_cast<int64_t>(frame_.cellSize(level));
        LatticeBox b;
        for (size_t a = 0; a < 3; ++a) {
            b.lo[a] = static_cast<int64_t>(compactBits(key >> a) << drop);
            b.hi[a] = b.lo[a] + size - 1;
        }
        return b;
    }
    static std::pair<size_t, size_t> rangeOf(const std::vector<K>& keys, K key, uint32_t shift) {
        const K lo = key >> shift << shift, last = lo | ((K{1} << shift) - 1);
        const auto first = std::lower_bound(keys.begin(), keys.end(), lo);
        const auto end = std::upper_bound(first, keys.end(), last);
        return {static_cast<size_t>(first - keys.begin()), static_cast<size_t>(end - keys.begin())};
    }

    /// Splits [begin, end), a cell of `level`, into blocks of `least` and finer.
    void blocks(size_t begin, size_t end, uint32_t level, uint32_t least) {
        if (begin == end) return;
        if (level >= frame_.keyLevels || (level >= least && end - begin <= kBlockPoints)) {
            block(begin, end, level);
            return;
        }
        const uint32_t shift = frame_.shiftOf(level + 1);
        while (begin < end) {
            const K child = keys_[begin] >> shift;
            const auto next = std::partition_point(keys_.begin() + static_cast<ptrdiff_t>(begin),
                                                   keys_.begin() + static_cast<ptrdiff_t>(end),
                                                   [&](K k) { return k >> shift == child; }) -
                              keys_.begin();
            blocks(begin, static_cast<size_t>(next), level + 1, least);
            begin = static_cast<size_t>(next);
        }
    }

    /// Calls f(x, y, z) for every point inside `box` that the counted cell sees, in the order of the keys: own first,
    /// then ghosts.
    template <typename F>
    void forPoints(const LatticeBox& box, K key, uint32_t level, const F& f) const {
        const uint32_t shift = frame_.shiftOf(level);
        const auto [begin, end] = rangeOf(keys_, key, shift);
        descend(keys_, own_.points, begin, end, level, box, f);
        const auto [first, last] = rangeOf(ghostKeys_, key, shift);
        descend(ghostKeys_, ghosts_, first, last, level, box, f);
    }
    /// Calls f(x, y, z) for point i.
    template <typename Of, typename F>
    static auto withPlace(const Of& points, size_t i, const F& f) {
        if (points.high.empty()) return f(points.x[i], points.y[i], points.z[i]);
        const Place p = placeOf(points.x[i], points.y[i], points.z[i], points.high[i]);
        return f(static_cast<int64_t>(p[0]), static_cast<int64_t>(p[1]), static_cast<int64_t>(p[2]));
    }
    template <typename Of, typename F>
    void descend(const std::vector<K>& keys, const Of& points, size_t begin, size_t end, uint32_t level,
                 const LatticeBox& box, const F& f) const {
        constexpr size_t kFew = 128;
        if (begin == end) return;
        if (end - begin <= kFew || level >= frame_.keyLevels) {
            for (size_t i = begin; i < end; ++i)
                withPlace(points, i, [&](int64_t x, int64_t y, int64_t z) {
                    if (box.holds(x, y, z) && isSeen(keys[i], x, y, z)) f(x, y, z);
                });
            return;
        }
        const uint32_t shift = frame_.shiftOf(level + 1);
        while (begin < end) {
            const K child = keys[begin] >> shift;
            const auto next = static_cast<size_t>(std::partition_point(keys.begin() + static_cast<ptrdiff_t>(begin),
                                                                       keys.begin() + static_cast<ptrdiff_t>(end),
                                                                       [&](K k) { return k >> shift == child; }) -
                                                  keys.begin());
            const LatticeBox at = boxOf(child << shift, level + 1);
            bool meets = true;
            for (size_t a = 0; a < 3; ++a) meets = meets && at.lo[a] <= box.hi[a] && at.hi[a] >= box.lo[a];
            if (meets) descend(keys, points, begin, next, level + 1, box, f);
            begin = next;
        }
    }
    /// The rule of Distributor.
    bool isSeen(K key, int64_t x, int64_t y, int64_t z) const {
        if (key >> cellShift_ == static_cast<K>(cell_.key) >> cellShift_) return true;
        int64_t reach = reach_;
        if (tree_.deepestLevel() > tree_.firstLevel()) {
            const Cell& other = tree_.cells()[tree_.cellOf(key)];
            reach = std::min(reach, static_cast<int64_t>(frame_.cellSize(other.level)) / 4);
        }
        return cellBox_.grown(reach).holds(x, y, z);
    }

    /// Everything within `margin` of the box of a cell of `level`, from that cell and its neighbours.
    template <typename F>
    void forNeighbourhood(K key, uint32_t level, int64_t margin, bool withOwn, const F& f) const {
        const LatticeBox own = boxOf(key, level), box = own.grown(margin);
        const auto size = static_cast<int64_t>(frame_.cellSize(level)), root = int64_t{1} << frame_.rootLog2;
        for (int64_t dz = -1; dz <= 1; ++dz)
            for (int64_t dy = -1; dy <= 1; ++dy)
                for (int64_t dx = -1; dx <= 1; ++dx) {
                    if (!withOwn && dx == 0 && dy == 0 && dz == 0) continue;
                    const int64_t x = own.lo[0] + dx * size, y = own.lo[1] + dy * size, z = own.lo[2] + dz * size;
                    if (x < 0 || y < 0 || z < 0 || x >= root || y >= root || z >= root) continue;
                    const Key at =
                        frame_.keyOf(static_cast<uint64_t>(x), static_cast<uint64_t>(y), static_cast<uint64_t>(z));
                    forPoints(box, static_cast<K>(at), level, f);
                }
    }

    void block(size_t begin, size_t end, uint32_t level) {
        const size_t n = end - begin;
        uint32_t splits = 0;
        while (splits < kMostSplits && level + splits < frame_.keyLevels && n > (size_t{8} << (2 * splits))) ++splits;
        const uint32_t window = level + splits;
        const uint32_t across = (1u << splits) + 2;
        const uint32_t edgeLog2 = frame_.rootLog2 - window;
        const int64_t edge = int64_t{1} << edgeLog2;
        const LatticeBox box = boxOf(keys_[begin], level);
        const float inverse = 1.0f / static_cast<float>(edge), half = 0.5f * static_cast<float>(1u << splits);
        const auto cellOf = [&](int64_t x, int64_t y, int64_t z) {
            const auto cx = static_cast<size_t>((x - box.lo[0] + edge) >> edgeLog2),
                       cy = static_cast<size_t>((y - box.lo[1] + edge) >> edgeLog2),
                       cz = static_cast<size_t>((z - box.lo[2] + edge) >> edgeLog2);
            return (cz * across + cy) * across + cx;
        };
        const auto localOf = [&](int64_t x, int64_t y, int64_t z) {
            return glm::vec3(static_cast<float>(x - box.lo[0]) * inverse - half,
                             static_cast<float>(y - box.lo[1]) * inverse - half,
                             static_cast<float>(z - box.lo[2]) * inverse - half);
        };
        seen_.clear();
        const auto add = [&](int64_t x, int64_t y, int64_t z) {
            seen_.push_back({static_cast<uint32_t>(cellOf(x, y, z)), localOf(x, y, z)});
        };
        for (size_t i = begin; i < end; ++i) withPlace(own_.points, i, add);
        forNeighbourhood(keys_[begin], level, edge, false, add);
        indexSeen(size_t{across} * across * across);
        const uint32_t windowShift = frame_.shiftOf(window);
        for (size_t i = begin; i < end;) {
            size_t next = i + 1;
            while (next < end && keys_[next] >> windowShift == keys_[i] >> windowShift) ++next;
            gather(seen_[i - begin].cell, across, kMostInThree, hood_);
            if (hood_.x.size() <= kNeighbours && window > coarsestWindow()) {
                largerWindow(i, next, window);
            } else {
                places_.clear();
                for (size_t k = i; k < next; ++k) places_.push_back(seen_[k - begin].place);
                give(i, next, static_cast<float>(edge), {next - i <= kSparse, seen_[i - begin].cell, across});
            }
            i = next;
        }
    }
    uint32_t coarsestWindow() const { return std::min(cell_.level + 2u, frame_.keyLevels); }

    /// Sorts what a block sees by window cell.
    void indexSeen(size_t cells) {
        firstSeen_.assign(cells + 1, 0);
        for (const Seen& s : seen_) ++firstSeen_[s.cell + 1];
        for (size_t i = 1; i < firstSeen_.size(); ++i) firstSeen_[i] += firstSeen_[i - 1];
        nextSeen_.assign(firstSeen_.begin(), firstSeen_.end());
        for (auto* axis : {&byCellX_, &byCellY_, &byCellZ_}) axis->resize(seen_.size());
        for (const Seen& s : seen_) {
            const uint32_t at = nextSeen_[s.cell]++;
            byCellX_[at] = s.place.x;
            byCellY_[at] = s.place.y;
            byCellZ_[at] = s.place.z;
        }
    }

    void clearHood() {
        hood_.x.clear();
        hood_.y.clear();
        hood_.z.clear();
    }
    void addToHood(const glm::vec3& p) {
        hood_.x.push_back(p.x);
        hood_.y.push_back(p.y);
        hood_.z.push_back(p.z);
    }
    /// Where a hood came from.
    struct Window {
        bool mayBeAlone;  ///< its points
        size_t cell;
        uint32_t across;  ///< 0: a larger window, of which the hood is all there is
    };
    struct Coordinates {
        std::vector<float> x, y, z;
        void resize(size_t n) {
            for (auto* axis : {&x, &y, &z}) axis->resize(n);
        }
    };
    /// The points of a window cell and its neighbours; of more than `most` in three cells only some.
    void gather(size_t at, uint32_t across, uint32_t most, Coordinates& to) {
        std::array<std::pair<uint32_t, uint32_t>, 9> runs;
        size_t all = 0;
        for (size_t row = 0; row < 9; ++row) {  // three cells in x lie side by side
            const size_t first = at + (row / 3 * across + row % 3) * across - (across + 1) * across - 1;
            runs.at(row) = {firstSeen_[first], firstSeen_[first + 3]};
            all += runs.at(row).second - runs.at(row).first;
        }
        to.resize(all);
        float *x = to.x.data(), *y = to.y.data(), *z = to.z.data();
        for (const auto& [begin, end] : runs) {
            const uint32_t stride = (end - begin) / most + 1;  // many lie at one place
            for (uint32_t k = begin; k < end; k += stride) {
                *x++ = byCellX_[k];
                *y++ = byCellY_[k];
                *z++ = byCellZ_[k];
            }
        }
        to.resize(static_cast<size_t>(x - to.x.data()));
    }

    /// The points [begin, end) of one window cell that has too few around it.
    void largerWindow(size_t begin, size_t end, uint32_t window) {
        int64_t size = 1;
        LatticeBox box;
        const auto localOf = [&](int64_t x, int64_t y, int64_t z) {
            const auto inverse = 1.0f / static_cast<float>(size);
            return glm::vec3(static_cast<float>(x - box.lo[0]) * inverse - 0.5f,
                             static_cast<float>(y - box.lo[1]) * inverse - 0.5f,
                             static_cast<float>(z - box.lo[2]) * inverse - 0.5f);
        };
        for (uint32_t level = window; level > coarsestWindow() && (level == window || hood_.x.size() <= kNeighbours);) {
            --level;
            size = static_cast<int64_t>(frame_.cellSize(level));
            box = boxOf(keys_[begin], level);
            clearHood();
            forNeighbourhood(keys_[begin], level, size, true,
                             [&](int64_t x, int64_t y, int64_t z) { addToHood(localOf(x, y, z)); });
        }
        places_.clear();
        for (size_t i = begin; i < end; ++i) places_.push_back(withPlace(own_.points, i, localOf));
        give(begin, end, static_cast<float>(size), {true, 0, 0});
    }

    /// Points [begin, end), whose places are in places_, from the hood; both in units of `edge` lattice units.
    void give(size_t begin, size_t end, float edge, const Window& window) {
        const size_t n = hood_.x.size();
        uint32_t normal = kNoNormal;
        if (settings_.normals && !settings_.isFine) {
            Moments all{};
            for (size_t k = 0; k < n; ++k) all.add(hood_.x[k], hood_.y[k], hood_.z[k]);
            normal = normalFrom(all);
        }
        squared_.resize(n + kSelectLanes);
        float reach = 0;
        for (size_t i = begin; i < end; ++i) {
            const glm::vec3 p = places_[i - begin];
            squaredDistances(hood_.x.data(), hood_.y.data(), hood_.z.data(), n, {p.x, p.y, p.z}, squared_.data());
            const size_t rank = std::min(kNeighbours, n - 1);  // the point itself comes first
            // (A little more than that of the point before is a good guess.)
            reach = rank > 0 ? smallestAtRank(squared_.data(), n, rank, 1.1f * reach) : 0.0f;
            if (settings_.radii && !(own_.points.radius[i] > 0)) {
                float& radius = own_.points.radius[i];
                radius = radiusFrom(reach, rank, edge);
                if (window.mayBeAlone && settings_.limitStrays && rank == kNeighbours && isAlone(n, reach))
                    radius = std::min(radius, kAloneSpacings * kSpacings * spacingOfOthers(window, reach) * edge);
            }
            if (!settings_.normals) continue;
            if (settings_.isFine) {
                Moments near{};
                for (size_t k = 0; k < n; ++k)
                    if (std::bit_cast<float>(squared_[k]) <= reach)
                        near.add(hood_.x[k] - p.x, hood_.y[k] - p.y, hood_.z[k] - p.z);
                normal = normalFrom(near);
            }
            uint32_t& colour = own_.points.colour[i];
            if (normal == kNoNormal || (colour >> 24 & shared::kFlagNoNormal) == 0) continue;
            own_.points.normal[i] = normal;
            colour = (colour & 0xffffffu) | (shared::kFlagTwoSided | shared::kFlagEstimatedNormal) << 24;
        }
    }
    /// Of a point whose squared distances to the hood are in squared_: are fewer than three others near it?
    bool isAlone(size_t n, float squaredReach) const {
        return smallestAtRank(squared_.data(), n, kCompanions, kNear2 * squaredReach) > kNear2 * squaredReach;
    }
    /// The median spacing of such a point's neighbours, in the hood's units: pi d^2 holds four of them. (The hood
    /// itself may hold only some of many points, see gather.)
    float spacingOfOthers(const Window& window, float squaredReach) {
        if (window.across > 0) gather(window.cell, window.across, ~0u, others_);
        const Coordinates& all = window.across > 0 ? others_ : hood_;
        const size_t n = all.x.size();
        squaredOfOther_.resize(n + kSelectLanes);
        spacings_.clear();
        for (size_t k = 0; k < hood_.x.size(); ++k) {
            const float squared = std::bit_cast<float>(squared_[k]);
            if (!(squared > 0) || squared > squaredReach) continue;
            squaredDistances(all.x.data(), all.y.data(), all.z.data(), n, {hood_.x[k], hood_.y[k], hood_.z[k]},
                             squaredOfOther_.data());
            spacings_.push_back(smallestAtRank(squaredOfOther_.data(), n, kOfOthers, 0));
        }
        if (spacings_.empty()) return 3.4e38f;
        const auto middle = spacings_.begin() + static_cast<ptrdiff_t>(spacings_.size() / 2);
        std::nth_element(spacings_.begin(), middle, spacings_.end());
        return std::sqrt(3.14159265f * *middle / static_cast<float>(kOfOthers));
    }
    float radiusFrom(float squaredReach, size_t neighbours, float edge) const {
        if (neighbours > 0)
            return kSpacings * std::sqrt(3.14159265f * squaredReach / static_cast<float>(neighbours)) * edge;
        const double alone = frame_.cellSize(cell_.level) / std::sqrt(static_cast<double>(cell_.count));
        return kSpacings * static_cast<float>(alone);
    }

    struct Seen {
        uint32_t cell;
        glm::vec3 place;
    };

    const Frame& frame_;
    const CellTree& tree_;
    const EstimateSettings settings_;
    const Places& ghosts_;
    SortedPoints& own_;
    const std::vector<K> keys_, ghostKeys_;
    Cell cell_;
    uint32_t cellShift_ = 0;
    LatticeBox cellBox_;
    int64_t reach_ = 0;
    std::vector<Seen> seen_;  ///< by the block: its own points first, in window cells from its centre
    std::vector<float> byCellX_, byCellY_, byCellZ_;  ///< the same by window cell
    std::vector<uint32_t> firstSeen_, nextSeen_;
    Coordinates hood_, others_;
    std::vector<int32_t> squared_, squaredOfOther_;  ///< bits of floats
    std::vector<float> spacings_;
    std::vector<glm::vec3> places_;
};

}  // namespace

void estimate(const Frame& frame, const CellTree& tree, uint32_t firstCell, uint32_t cells,
              const EstimateSettings& settings, const Places& ghosts, SortedPoints& own) {
    Points& p = own.points;
    p.normal.resize(p.size());
    p.radius.resize(p.size());
    if (settings.radii || settings.normals) {
        const auto all = [&](auto estimator) {
            for (uint32_t k = 0; k < cells; ++k) estimator.cell(firstCell + k);
        };
        if (frame.keyLevels > kShortBits)
            all(Estimator<Key>(frame, tree, settings, ghosts, own));
        else
            all(Estimator<uint64_t>(frame, tree, settings, ghosts, own));
    }
    // Stray points have their neighbours far away.
    const float limit =
        settings.limitStrays ? static_cast<float>(kLargestSpacings * kSpacings * tree.largeSpacing()) : 3.4e38f;
    for (float& r : p.radius) r = std::max(std::min(r, limit), 0.5f);
}

}  // namespace stipple::lod
