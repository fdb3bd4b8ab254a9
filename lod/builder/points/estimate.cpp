// A block is an octree cell of at most kBlockPoints points, a quarter of its counted cell at most. It is split evenly
// into window cells of two to eight points (if they lie on a surface). What is estimated at the points of a window cell
// comes from it and its 26 neighbours:
//   radius  to the farthest corner of its Voronoi cell in the plane (farthestCorner), and a tenth more: no larger than
//           what closes the surface. Corners farther than 1.8 spacings (1.25 where it bends) are its edge; the spacing
//           comes from the distance d of the 12th neighbour: pi d^2 holds 12 of them. Copies count once.
//           Where the window bends, no farther than 1.2 times the third neighbour; where it is a volume (leaves) 0.85
//           times. Discs that this makes narrower leave the gaps between them open: nothing was seen there. (Not if the
//           block as a whole is a sheet, which is noise or grass that has to stay closed.)
//   normal  the direction of least variance (Hoppe et al. 1992), sign unknown: two-sided. Of all points of the window,
//           the same for all points of the cell; or, fine and where the window bends (one normal for both sides of a
//           fold would leave it open), of each point's own twelve nearest.
// A point that stands alone, away from what its neighbours belong to, has the disc of those: of twice their spacing at
// most (spacingOfOthers).
// With fewer points in the window it grows, up to the quarter of a counted cell that buckets know of their neighbours
// (Distributor); then what is there must do. All of this hangs on the lattice and on counts alone.
#include "lod/builder/points/estimate.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "lod/builder/points/seen.h"
#include "lod/builder/points/select.h"
#include "lod/builder/points/surface_fit.h"
#include "lod/builder/points/surroundings.h"
#include "lod/primitives/octahedral.h"

namespace stipple::lod {
namespace {

constexpr size_t kBlockPoints = 2048, kNeighbours = 12;
constexpr uint32_t kMostSplits = 5, kMostInThree = 128;
constexpr size_t kCrowdAround = 9, kFewAround = 256;  ///< places seen, of a place of its own and beside
constexpr float kSpacings = 1.368f;
constexpr double kLargestSpacings = 3;
constexpr size_t kSparse = 2;        ///< points of a window cell, or fewer, that may stand alone
constexpr size_t kCompanions = 3;    ///< at least that many of twelve neighbours are near by, or a point stands alone:
constexpr float kNear2 = 0.5f;       ///< squared, of the distance of the twelfth (on a surface: 1/4)
constexpr size_t kOfOthers = 4;      ///< rank of the neighbour that tells the spacing of others
constexpr float kAloneSpacings = 2;  ///< how much wider than of its neighbours the disc of such a point may be
constexpr size_t kCrowd = 8;
constexpr float kCrowdsGap = 2.0f;
constexpr uint32_t kAcrossLines = 3;  ///< so often a window that holds but a line is doubled
constexpr double kFlat = 0.02, kBent = 0.05;
constexpr double kSlim = 0.06, kSlimOfFew = 0.2;
constexpr float kPlain = 0.8f;
constexpr float kWidestGap = 2.0f, kWidestFold = 1.5f;  ///< spacings; farther corners are edges
constexpr float kAcrossGap = 2.5f, kAcrossMost = 1.6f, kUneven = 1.2f;
constexpr float kOverlap = 1.15f;
// Variances, least over middle: an edge between two walls has a quarter at most.
constexpr double kThick = 0.3, kThickish = 0.12, kSheet = 0.04;
constexpr size_t kEnoughOfSheet = 256;                     ///< places of a block
constexpr size_t kFewNearest = 3;                          ///< rank of the neighbour that says how near others are
constexpr float kFewOfReach = 0.35f;                       ///< its squared distance over that of the twelfth, about
constexpr float kAmongLeaves = 0.85f, kAcrossBend = 1.2f;  ///< radius over its distance, at most

constexpr uint32_t kNoNormal = ~0u;  ///< no octahedral code

/// K: see Surroundings.
template <typename K>
class Estimator : Surroundings<K> {
  public:
    Estimator(const Frame& frame, const CellTree& tree, const EstimateSettings& settings, const SeenKeys<K>& keys,
              const Places& ghosts, SortedPoints& own)
        : Surroundings<K>(frame, tree, keys, ghosts, own), settings_(settings) {}

    void cell(uint32_t index) {
        const Cell& c = tree_.cells()[index];
        setCell(c);
        const auto [begin, end] = keyRange(keys_, static_cast<K>(c.key), cellShift_, allOwn());
        if (begin == end) return;
        blocks(begin, end, c.level, std::min<uint32_t>(c.level + 2u, frame_.keyLevels));
    }

  private:
    using Near = Surroundings<K>;
    using Near::allOwn, Near::boxOf, Near::findAround, Near::forChildren, Near::forNeighbourhood, Near::setCell,
        Near::withPlace;
    using Near::cell_, Near::cellShift_, Near::frame_, Near::keys_, Near::own_, Near::tree_;

    /// Splits [begin, end), a cell of `level`, into blocks of `least` and finer.
    void blocks(size_t begin, size_t end, uint32_t level, uint32_t least) {
        if (begin == end) return;
        if (level >= frame_.keyLevels || (level >= least && end - begin <= kBlockPoints)) {
            block(begin, end, level);
            return;
        }
        forChildren(begin, end, level, [&](size_t from, size_t to) { blocks(from, to, level + 1, least); });
    }
    void findPlaces(size_t begin, size_t end) {
        const Points& p = own_.points;
        placeBegin_.clear();
        for (size_t i = begin; i < end; ++i)
            if (i == begin || keys_[i] != keys_[i - 1] || p.x[i] != p.x[i - 1] || p.y[i] != p.y[i - 1] ||
                p.z[i] != p.z[i - 1] || (!p.high.empty() && p.high[i] != p.high[i - 1]))
                placeBegin_.push_back(i);
        placeBegin_.push_back(end);
    }
    /// Clusters far apart: splitting cells that hold one each leaves as many of them. True if so; then fewer splits.
    bool skipEmptySplits(uint32_t level, uint32_t& splits) const {
        // Cells of each split that hold places: a new one begins where keys differ in a bit above it.
        std::array<size_t, kMostSplits + 2> occupied{};
        const uint32_t shift = frame_.shiftOf(level + splits);
        for (size_t j = 1; j + 1 < placeBegin_.size(); ++j) {
            const K differs = (keys_[placeBegin_[j]] ^ keys_[placeBegin_[j - 1]]) >> shift;
            ++occupied.at(differs == 0 ? kMostSplits + 1 : splits - (bitWidth(differs) - 1) / 3);
        }
        ++occupied[0];
        for (size_t s = 1; s <= splits; ++s) occupied.at(s) += occupied.at(s - 1);
        const uint32_t wanted = splits;
        const size_t places = placeBegin_.size() - 1;
        while (splits > 0 && occupied.at(splits) >= kCrowd && places > kCrowd * occupied.at(splits) &&
               occupied.at(splits) * 10 < occupied.at(splits - 1) * 14)
            --splits;
        return splits < wanted;
    }

    void block(size_t begin, size_t end, uint32_t level) {
        findPlaces(begin, end);
        findAround(keys_[begin], level);
        const size_t n = placeBegin_.size() - 1;
        uint32_t splits = 0;
        while (splits < kMostSplits && level + splits < frame_.keyLevels && n > (size_t{8} << (2 * splits))) ++splits;
        const bool isClustered = skipEmptySplits(level, splits);
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
        const auto see = [&](int64_t x, int64_t y, int64_t z) {
            seen_.add(static_cast<uint32_t>(cellOf(x, y, z)), localOf(x, y, z));
        };
        for (size_t j = 0; j < n; ++j) {
            const size_t i = placeBegin_[j];
            withPlace(own_.points, i, see);
        }
        isSheet_ = isSheet(n);
        forNeighbourhood(keys_[begin], level, edge, false, OncePerPlace{see});
        // A few points on this side of a border and many beyond: windows are to be as small as theirs.
        if (seen_.size() > kCrowdAround * n + kFewAround && level + 1 < frame_.keyLevels)
            return forChildren(begin, end, level, [&](size_t from, size_t to) { block(from, to, level + 1); });
        seen_.index(size_t{across} * across * across);
        const uint32_t windowShift = frame_.shiftOf(window);
        for (size_t j = 0; j < n;) {
            const K key = keys_[placeBegin_[j]] >> windowShift;
            size_t next = j + 1;
            while (next < n && keys_[placeBegin_[next]] >> windowShift == key) ++next;
            seen_.gather(seen_[j].cell, across, kMostInThree, neighbourhood_);
            places_.clear();
            for (size_t k = j; k < next; ++k) places_.push_back(seen_[k].at);
            Window at;
            at.edge = static_cast<float>(edge);
            at.mayBeAlone = next - j <= kSparse;
            at.cell = seen_[j].cell;
            at.across = across;
            at.widestGap = isClustered ? kCrowdsGap : 0.0f;
            measure(at);
            if (window > coarsestWindow() && (neighbourhood_.count <= kNeighbours || at.isLine))
                largerWindow(j, next, window, at);
            give(j, next, at);
            j = next;
        }
    }
    uint32_t coarsestWindow() const { return std::min(cell_.level + 2u, frame_.keyLevels); }

    /// Are the first `n` places seen, a block's own, a sheet as a whole? Then it may be noise that makes windows thick.
    bool isSheet(size_t n) {
        if (n < kEnoughOfSheet) return false;
        neighbourhood_.count = 0;
        for (size_t j = 0; j < n; ++j) neighbourhood_.add(seen_[j].at);
        return !spreadOfNeighbourhood(seen_[0].at).isThick(kSheet);
    }

    /// Where a neighbourhood came from, and how it is spread.
    struct Window {
        float edge = 1;           ///< lattice units; all lengths in neighbourhoods are in units of it
        bool mayBeAlone = false;  ///< its points
        size_t cell = 0;
        uint32_t across = 0;  ///< 0: a larger window, of which the neighbourhood is all there is
        Spread spread;
        bool isLine = false, isFlat = false, isBent = false;
        float widestGap = 0;  ///< between its neighbours, if they are not spread evenly; 0: they are
    };
    /// Of all in the neighbourhood. `p`: one of them.
    Spread spreadOfNeighbourhood(const glm::vec3& p) {
        squared_.assign((neighbourhood_.count + kLanes) / kLanes * kLanes, kNothing);
        std::fill_n(squared_.begin(), neighbourhood_.count, 0);
        return spreadOf(neighbourhood_.neighbours(), {p.x, p.y, p.z}, squared_.data(), 0);
    }
    void measure(Window& window) {
        window.spread = spreadOfNeighbourhood(places_.front());
        window.isLine = window.spread.isLine(roundingIn(window.edge), kSlim);
        window.isFlat = window.spread.least < kFlat * window.spread.middle;
        window.isBent = !(window.spread.least < kBent * window.spread.middle);
    }
    /// Variance of a coordinate's rounding to the lattice.
    static double roundingIn(float edge) {
        return 1.0 / (12.0 * static_cast<double>(edge) * static_cast<double>(edge));
    }

    /// The places [begin, end) of one window cell that has too few around it, or only such along a line.
    void largerWindow(size_t begin, size_t end, uint32_t level, Window& window) {
        int64_t size = 1;
        LatticeBox box;
        const auto localOf = [&](int64_t x, int64_t y, int64_t z) {
            const auto inverse = 1.0f / static_cast<float>(size);
            return glm::vec3(static_cast<float>(x - box.lo[0]) * inverse - 0.5f,
                             static_cast<float>(y - box.lo[1]) * inverse - 0.5f,
                             static_cast<float>(z - box.lo[2]) * inverse - 0.5f);
        };
        const size_t first = placeBegin_[begin];
        bool isKept = false;
        const auto keep = [&] {  // a line, if nothing lies beside it
            isKept = true;
            std::swap(neighbourhood_, lineNeighbourhood_);
            std::swap(places_, linePlaces_);
            lineWindow_ = window;
        };
        if (neighbourhood_.count > kNeighbours) keep();
        neighbourhood_.count = 0;
        for (uint32_t across = 0;
             level > coarsestWindow() && (neighbourhood_.count <= kNeighbours || across < kAcrossLines);) {
            --level;
            size = static_cast<int64_t>(frame_.cellSize(level));
            box = boxOf(keys_[first], level);
            neighbourhood_.count = 0;
            forNeighbourhood(keys_[first], level, size, true, OncePerPlace{[&](int64_t x, int64_t y, int64_t z) {
                                 neighbourhood_.add(localOf(x, y, z));
                             }});
            places_.clear();
            for (size_t j = begin; j < end; ++j) {
                const size_t i = placeBegin_[j];
                places_.push_back(withPlace(own_.points, i, localOf));
            }
            window.edge = static_cast<float>(size);
            measure(window);
            if (neighbourhood_.count <= kNeighbours) continue;
            if (!window.isLine) break;
            if (!isKept) keep();
            ++across;
        }
        if (window.isLine && isKept) {
            std::swap(neighbourhood_, lineNeighbourhood_);
            std::swap(places_, linePlaces_);
            window = lineWindow_;
            return;
        }
        window.mayBeAlone = window.mayBeAlone || !isKept;
        window.across = 0;
    }

    /// Places [begin, end), whose coordinates are in places_, from the neighbourhood.
    void give(size_t begin, size_t end, const Window& window) {
        const size_t n = neighbourhood_.count, rank = std::min(kNeighbours, n - 1);  // the point itself comes first
        const Neighbours all = neighbourhood_.neighbours();
        const bool hasOwnNormals = settings_.isFine || window.isBent, isEach = hasOwnNormals || window.mayBeAlone;
        squared_.resize(n + kLanes);
        // Of a rectangle's points that are spread evenly: variances are 1/12 of its sides squared.
        const Spread& whole = window.spread;
        const auto evenly = static_cast<float>(whole.points < 3 ? 0
                                                                : std::sqrt(12 * std::sqrt(whole.most * whole.middle) /
                                                                            static_cast<double>(whole.points)));
        float reach = 0;
        const auto measureReach = [&](const glm::vec3& p) {
            squaredDistances(all.x, all.y, all.z, n, {p.x, p.y, p.z}, squared_.data());
            // (A little more than that of the point before is a good guess.)
            reach = rank > 0 ? smallestAtRank(squared_.data(), n, rank, 1.1f * reach) : 0.0f;
        };
        float nearer = 3.4e38f;
        if (!isEach) {
            measureReach(places_.front());
            const float one = reach;
            measureReach(places_.back());
            nearer = spacingOf(std::min(one, reach), rank);
            reach = std::max(one, reach);
        }
        Spread spread = window.spread;
        bool isLine = window.isLine;
        uint32_t normal = isLine || spread.normal == glm::vec3(0) ? kNoNormal : roundedNormal(spread.normal);
        for (size_t j = begin; j < end; ++j) {
            const glm::vec3 p = places_[j - begin];
            if (isEach) measureReach(p);
            if (hasOwnNormals && n > 3) {
                // Those along one line say nothing: twice as far, until there are others.
                float squared = reach;
                do {
                    spread = spreadOf(all, {p.x, p.y, p.z}, squared_.data(), squared);
                    squared *= 4;
                    isLine = spread.isLine(roundingIn(window.edge), kSlimOfFew);
                } while (isLine && spread.points < n && squared < 1e30f && squared > 0);
                normal = isLine || spread.normal == glm::vec3(0) ? kNoNormal : roundedNormal(spread.normal);
            }
            float wanted = 0;  // one for all at the place that have no normals of their own
            uint32_t joined = 0;
            for (size_t i = placeBegin_[j]; i < placeBegin_[j + 1]; ++i) {
                uint32_t& colour = own_.points.colour[i];
                const bool hasOwn = (colour >> 24 & shared::kFlagNoNormal) == 0;
                if (settings_.radii && !(own_.points.radius[i] > 0)) {
                    if (hasOwn || !(wanted > 0)) {
                        glm::vec3 axis = spread.along, across = glm::cross(spread.normal, spread.along);
                        if (hasOwn) {
                            const glm::vec3 own = shared::octDecode(own_.points.normal[i]);
                            axis = glm::normalize(std::abs(own.x) < 0.7f ? glm::vec3(0, -own.z, own.y)
                                                                         : glm::vec3(-own.z, 0, own.x));
                            across = glm::cross(own, axis);
                        }
                        wanted = radiusAt(p, axis, across, isLine && !hasOwn, reach, rank, window, evenly, nearer);
                        joined = isLine || isStray_ ? shared::kFlagScattered : 0u;
                        if (window.isBent && !isSheet_ && !window.isLine && n > kFewNearest)
                            joined |= limitToNearest(wanted, reach, window, spread);
                    }
                    own_.points.radius[i] = wanted;
                    if (hasOwn) wanted = 0;
                    colour |= joined << 24;
                }
                if (!settings_.normals || normal == kNoNormal || hasOwn) continue;
                own_.points.normal[i] = normal;
                colour = (colour & ~(shared::kFlagNoNormal << 24)) |
                         (shared::kFlagTwoSided | shared::kFlagEstimatedNormal) << 24;
            }
        }
    }
    /// Of points on a surface, from the squared distance of the one at `rank`: pi d^2 holds as many.
    static float spacingOf(float squaredReach, size_t rank) {
        return rank == 0 ? 0.0f : std::sqrt(3.14159265f * squaredReach / static_cast<float>(rank));
    }
    /// Lattice units.
    float radiusAt(const glm::vec3& p, const glm::vec3& axis, const glm::vec3& across, bool isLine, float squaredReach,
                   size_t rank, const Window& window, float evenly, float nearer) {
        if (rank == 0) {
            const double alone = frame_.cellSize(cell_.level) / std::sqrt(static_cast<double>(cell_.count));
            return kSpacings * static_cast<float>(alone);
        }
        const float spacing = spacingOf(squaredReach, rank);
        nearer = std::min(nearer, spacing);
        float most = std::max((window.isFlat ? kWidestGap : kWidestFold) * spacing, window.widestGap);
        // Scan lines: nearer along them than is even.
        bool isUneven = window.isFlat && evenly > kUneven * nearer;
        glm::vec3 first = axis, second = across;
        if (isUneven) {
            // The cells are narrow: the directions have to fit them.
            squaredDistances(neighbourhood_.x.data(), neighbourhood_.y.data(), neighbourhood_.z.data(),
                             neighbourhood_.count, {p.x, p.y, p.z}, squared_.data());
            const Spread near = spreadOf(neighbourhood_.neighbours(), {p.x, p.y, p.z}, squared_.data(), squaredReach);
            const glm::vec3& along = near.along;
            isUneven = near.middle < kSlimOfFew * near.most || evenly > 2 * nearer;
            const glm::vec3 flat = glm::dot(along, axis) * axis + glm::dot(along, across) * across;
            if (glm::dot(flat, flat) > 0.25f) {
                first = glm::normalize(flat);
                second = glm::cross(glm::cross(axis, across), first);
            }
        }
        if (isUneven) most = std::max(most, std::min(kAcrossGap * evenly, kAcrossMost));
        std::array<float, kDirections> inverse =
            inverseExtents(neighbourhood_.neighbours(), {p.x, p.y, p.z}, first, second, most);
        if (isLine)  // only the two along it count
            for (size_t k = 0; k < kDirections; ++k)
                if (k % (kDirections / 2) != 0) inverse.at(k) = std::numeric_limits<float>::infinity();
        float radius = kOverlap * farthestCorner(inverse, most, isUneven || isLine || window.widestGap > 0);
        if (!(radius > 0)) radius = kPlain * spacing;
        isStray_ = window.mayBeAlone && settings_.limitStrays && rank == kNeighbours &&
                   isAlone(neighbourhood_.count, squaredReach);
        if (isStray_) radius = std::min(radius, kAloneSpacings * kSpacings * spacingOfOthers(window, squaredReach));
        return radius * window.edge;
    }
    /// Of a point whose squared distances to the neighbourhood are in squared_ and which may be no part of a surface:
    /// `radius` (lattice units) as far as the next few others are. Returns flags. `near`: how the twelve nearest are
    /// spread.
    uint32_t limitToNearest(float& radius, float squaredReach, const Window& window, const Spread& near) const {
        const float squared =
            smallestAtRank(squared_.data(), neighbourhood_.count, kFewNearest, kFewOfReach * squaredReach);
        const float others = std::sqrt(squared) * window.edge;
        const bool isVolume =
            window.spread.isThick(kThick) || (window.spread.isThick(kThickish) && near.isThick(kThick));
        // Round bodies of few points bend their windows, not what is around a point.
        const bool isLeafy = near.isThick(kThickish) && (window.spread.isThick(kThickish) || window.across == 0);
        const bool isLeafLike = radius > (isVolume ? 1.0f : kAcrossBend) * others;
        radius = std::min(radius, (isVolume ? kAmongLeaves : kAcrossBend) * others);
        return (isLeafy || isLeafLike ? shared::kFlagScattered : 0u) | (isLeafLike ? shared::kFlagLeaf : 0u);
    }
    /// Of a point whose squared distances to the neighbourhood are in squared_: are fewer than three others near it?
    bool isAlone(size_t n, float squaredReach) const {
        return smallestAtRank(squared_.data(), n, kCompanions, kNear2 * squaredReach) > kNear2 * squaredReach;
    }
    /// The median spacing of such a point's neighbours, in the neighbourhood's units: pi d^2 holds four of them. (The
    /// neighbourhood itself may hold only some of many points, see gather.)
    float spacingOfOthers(const Window& window, float squaredReach) {
        if (window.across > 0) seen_.gather(window.cell, window.across, ~0u, others_);
        const Neighbourhood& all = window.across > 0 ? others_ : neighbourhood_;
        const size_t n = all.count;
        squaredOfOther_.resize(n + kLanes);
        spacings_.clear();
        for (size_t k = 0; k < neighbourhood_.count; ++k) {
            const float squared = std::bit_cast<float>(squared_[k]);
            if (!(squared > 0) || squared > squaredReach) continue;
            squaredDistances(all.x.data(), all.y.data(), all.z.data(), n,
                             {neighbourhood_.x[k], neighbourhood_.y[k], neighbourhood_.z[k]}, squaredOfOther_.data());
            spacings_.push_back(smallestAtRank(squaredOfOther_.data(), n, kOfOthers, 0));
        }
        if (spacings_.empty()) return 3.4e38f;
        const auto middle = spacings_.begin() + static_cast<ptrdiff_t>(spacings_.size() / 2);
        std::nth_element(spacings_.begin(), middle, spacings_.end());
        return std::sqrt(3.14159265f * *middle / static_cast<float>(kOfOthers));
    }

    const EstimateSettings settings_;
    bool isSheet_ = false;  ///< the block
    bool isStray_ = false;  ///< the point that radiusAt saw last
    Seen seen_;             ///< by the block: its own points first
    Neighbourhood neighbourhood_, others_, lineNeighbourhood_;
    std::vector<int32_t> squared_, squaredOfOther_;  ///< bits of floats
    std::vector<float> spacings_;
    std::vector<size_t> placeBegin_;  ///< of the block's own places, the first point of each, and the end
    std::vector<glm::vec3> places_, linePlaces_;
    Window lineWindow_;
};

}  // namespace

void estimate(const Frame& frame, const CellTree& tree, uint32_t firstCell, uint32_t cells,
              const EstimateSettings& settings, const Places& ghosts, Executor& executor, SortedPoints& own) {
    Points& p = own.points;
    p.normal.resize(p.size());
    p.radius.resize(p.size());
    const auto all = [&]<typename K>(const SeenKeys<K>& keys) {
        const size_t least = executor.threads() > 1 ? 1 : cells;  // an estimator's memory grows with what it sees
        executor.parallelFor(cells, least, [&](size_t begin, size_t end) {
            Estimator<K> estimator(frame, tree, settings, keys, ghosts, own);
            for (size_t k = begin; k < end; ++k) estimator.cell(firstCell + static_cast<uint32_t>(k));
        });
    };
    if (settings.radii || settings.normals) {
        if (frame.keyLevels > kShortBits)
            all(SeenKeys<Key>(ghosts, own));
        else
            all(SeenKeys<uint64_t>(ghosts, own));
    }
    // Stray points have their neighbours far away.
    const float limit =
        settings.limitStrays ? static_cast<float>(kLargestSpacings * kSpacings * tree.largeSpacing()) : 3.4e38f;
    for (float& r : p.radius) r = std::max(std::min(r, limit), 0.5f);
}

}  // namespace stipple::lod
