#include "lod/verify/errors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "lod/primitives/triangle.h"
#include "lod/store/mesh_place.h"
#include "lod/verify/discs.h"
#include "lod/verify/fault.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kClusterLevels = 6;  ///< a record stands for a cell that many levels below its node's

/// Has it children, and all of them are leaves?
bool isAboveLeaves(const Hierarchy& h, const Node& node) {
    for (uint32_t c = 0; c < static_cast<uint32_t>(__builtin_popcount(node.childMask)); ++c)
        if (!h.nodes[node.firstChild + c].isLeaf()) return false;
    return !node.isLeaf();
}

std::vector<Disc> discsOf(const Hierarchy& h, const Node& node, const Chunk& chunk, double clusterSize,
                          size_t first = 0) {
    std::vector<Disc> discs;
    discs.reserve(chunk.records.size());
    addDiscs(h, node, chunk, first, chunk.records.size(), clusterSize, discs);
    return discs;
}

/// Largest distance of a place of `leaf` from the disc `record`, at most.
double distanceOf(const Disc& record, const Disc& leaf) {
    const glm::dvec3 d = leaf.place - record.place;
    if (!record.hasNormal) return std::max(0.0, glm::length(d) + leaf.radius - record.radius);
    const double along = leaf.hasNormal ? std::abs(glm::dot(record.normal, leaf.normal)) : 0.0;
    const double height = glm::dot(d, record.normal);
    const double rise = leaf.radius * std::sqrt(std::max(0.0, 1 - along * along));
    const double sideways = std::max(0.0, glm::length(d - height * record.normal) + leaf.radius - record.radius);
    return std::hypot(std::abs(height) + rise, sideways);
}

tl::unexpected<Error> tooFar(const Store& store, uint32_t index, double off, double error) {
    return wrong(store, index,
                 fmt::format("a place of a record's disc is {:.6g} lattice units off the nearest leaf, its error says "
                             "{:.6g}",
                             off, error));
}

/// Leaves of a node by the clusters' cells that they lie in.
class LeafGrid {
  public:
    LeafGrid(std::vector<Disc> leaves, const Node& node, uint32_t across)
        : leaves_(std::move(leaves)), across_(across), start_(size_t{across} * across * across + 1, 0) {
        for (size_t a = 0; a < 3; ++a) first_.at(a) = uint64_t{node.cell.at(a)} * across;
        for (const Disc& leaf : leaves_) ++start_[numberOf(leaf)];
        for (uint32_t sum = 0; uint32_t & s : start_) s = sum += s;
        order_.resize(leaves_.size());
        for (uint32_t i = 0; i < leaves_.size(); ++i) order_[--start_[numberOf(leaves_[i])]] = i;
    }
    /// Of `place`, which belongs to a record in `cell`, from the nearest leaf; where one is as near as `enough`, of
    /// any such.
    double distance(const glm::dvec3& place, const std::array<uint64_t, 3>& cell, bool isBall, double enough) const {
        double least = 1e300;
        const auto isEnough = [&](const Disc& leaf) {
            least = std::min(least, distanceOf(place, leaf, isBall));
            return least <= enough;
        };
        for (const int reach : {0, 1})
            for (int k = 0; k < 27; ++k) {
                const std::array<int, 3> to{k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
                if ((k == 13) != (reach == 0)) continue;
                size_t number = 0;
                bool isInside = true;
                for (size_t a = 3; a-- > 0;) {
                    const uint64_t at = cell.at(a) - first_.at(a) + static_cast<uint64_t>(to.at(a));
                    isInside = isInside && at < across_;
                    number = number * across_ + at;
                }
                if (!isInside) continue;
                for (uint32_t i = start_[number]; i < start_[number + 1]; ++i)
                    if (isEnough(leaves_[order_[i]])) return least;
            }
        for (const Disc& leaf : leaves_)
            if (isEnough(leaf)) return least;
        return least;
    }

  private:
    size_t numberOf(const Disc& leaf) const {
        size_t number = 0;
        for (size_t a = 3; a-- > 0;)
            number = number * across_ + std::min<uint64_t>(leaf.cell.at(a) - first_.at(a), across_ - 1);
        return number;
    }
    std::vector<Disc> leaves_;
    uint64_t across_;
    std::array<uint64_t, 3> first_{};
    std::vector<uint32_t> start_, order_;
};

/// The leaves below a node, read as they are asked for.
class LeavesBelow {
  public:
    LeavesBelow(const Store& store, uint32_t top) : store_(store), top_(top) {}
    /// From the nearest leaf; where one is as near as `enough`, of any such.
    Result<double> distance(const glm::dvec3& place, bool isBall, double enough) {
        double least = 1e300;
        STIPPLE_TRY(look(top_, place, isBall, enough, least));
        return least;
    }

  private:
    static constexpr size_t kMostKept = 32;
    double outside(const Node& node, const glm::dvec3& place) const {
        return glm::length(place - node.centre) - node.radius;
    }
    Result<void> look(uint32_t index, const glm::dvec3& place, bool isBall, double enough, double& least) {
        const Hierarchy& h = store_.hierarchy;
        const Node& node = h.nodes[index];
        if (least <= enough || outside(node, place) > least) return {};
        if (node.isLeaf()) {
            auto kept = kept_.find(index);
            if (kept == kept_.end()) {
                if (kept_.size() >= kMostKept) kept_.clear();
                STIPPLE_ASSIGN(const Chunk chunk, readChunk(store_, index, true));
                kept = kept_.emplace(index, discsOf(h, node, chunk, 1)).first;
            }
            for (const Disc& leaf : kept->second) {
                least = std::min(least, distanceOf(place, leaf, isBall));
                if (least <= enough) break;
            }
            return {};
        }
        std::vector<std::pair<double, uint32_t>> order;
        const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c)
            order.emplace_back(glm::length(place - h.nodes[c].centre), c);
        std::sort(order.begin(), order.end());
        for (const auto& [distance, child] : order) STIPPLE_TRY(look(child, place, isBall, enough, least));
        return {};
    }
    const Store& store_;
    uint32_t top_;
    std::map<uint32_t, std::vector<Disc>> kept_;
};

/// A few records of a node far above the leaves: those whose errors say least for their size.
Result<uint64_t> measureFew(const Store& store, uint32_t index, const std::vector<Disc>& records) {
    constexpr size_t kFew = 16;
    const Hierarchy& h = store.hierarchy;
    std::vector<std::pair<double, size_t>> order;
    for (size_t i = 0; i < records.size(); ++i)
        order.emplace_back(h.errors.decode(records[i].code) / records[i].radius, i);
    const size_t count = std::min(kFew, order.size());
    std::partial_sort(order.begin(), order.begin() + static_cast<ptrdiff_t>(count), order.end());
    LeavesBelow leaves(store, index);
    for (size_t k = 0; k < count; ++k) {
        const Disc& record = records[order[k].second];
        const double error = h.errors.decode(record.code),
                     enough = error * (1 + 1e-5) + 1e-6 * h.cellSize(h.nodes[index]);
        std::optional<Error> unreadable;
        const double off = farthestPlace(record, 1, 8, enough, [&](const glm::dvec3& place) {
            const auto distance = leaves.distance(place, !record.hasNormal, enough);
            if (!distance) unreadable = distance.error();
            return distance ? *distance : 0.0;
        });
        if (unreadable) return tl::unexpected(*unreadable);
        if (off > enough && record.code < ErrorScale::kLargest) return tooFar(store, index, off, error);
    }
    return count;
}

/// With clusters as cells of `clusterLevel`.
Result<uint64_t> measureErrorsAt(const Store& store, uint32_t index, const Chunk& chunk, uint64_t most,
                                 uint32_t clusterLevel) {
    const Hierarchy& h = store.hierarchy;
    const Node& node = h.nodes[index];
    const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
    const double clusterSize = std::exp2(static_cast<double>(h.rootLog2) - clusterLevel);
    std::vector<Disc> records = discsOf(h, node, chunk, clusterSize, overviewOf(h, node, chunk));
    const auto isLess = [](const Disc& a, const Disc& b) { return a.cell < b.cell; };
    std::sort(records.begin(), records.end(), isLess);
    // Discs are rounded to fp32 in between.
    const double rounding = 1e-6 * h.cellSize(node);
    std::vector<double> bounds(records.size());
    for (size_t i = 0; i < records.size(); ++i) bounds[i] = h.errors.decode(records[i].code);
    // (What a chunk holds it says itself: what the table says of one that is damaged may be anything.)
    std::vector<Chunk> below;
    size_t count = 0;
    for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
        STIPPLE_ASSIGN(Chunk child, readChunk(store, c, true));
        count += child.records.size();
        below.push_back(std::move(child));
    }
    std::vector<Disc> leaves;
    leaves.reserve(count);
    for (uint32_t c = 0; c < children; ++c)
        addDiscs(h, h.nodes[node.firstChild + c], below[c], 0, below[c].records.size(), clusterSize, leaves);
    for (const Disc& leaf : leaves) {
        // A cell may have several records, for several cones of normals: one of them stands for the leaf.
        auto at = std::lower_bound(records.begin(), records.end(), leaf, isLess);
        double off = 1e300, error = 0;
        bool isUnbounded = false;
        for (; at != records.end() && at->cell == leaf.cell; ++at) {
            const double distance = distanceOf(*at, leaf), bound = bounds[static_cast<size_t>(at - records.begin())];
            isUnbounded = isUnbounded || at->code >= ErrorScale::kLargest;
            if (distance - bound >= off - error) continue;
            off = distance;
            error = bound;
        }
        if (off <= error * (1 + 1e-5) + rounding || isUnbounded) continue;
        return wrong(store, index,
                     off < 1e300
                         ? fmt::format("a record is {:.6g} lattice units off a leaf, its error says {:.6g}", off, error)
                         : "a leaf has no record above it");
    }
    const LeafGrid grid(std::move(leaves), node, 1u << (clusterLevel - node.level));
    const size_t stride = records.size() / most + 1;
    for (size_t i = 0; i < records.size(); i += stride) {
        const double error = bounds[i], enough = error * (1 + 1e-5) + rounding;
        const double off = farthestPlace(records[i], 2, 16, enough, [&](const glm::dvec3& place) {
            return grid.distance(place, records[i].cell, !records[i].hasNormal, enough);
        });
        if (off > enough && records[i].code < ErrorScale::kLargest) return tooFar(store, index, off, error);
    }
    return records.size();
}

}  // namespace

Result<uint64_t> measureErrors(const Store& store, uint32_t index, const Chunk& chunk, uint64_t most) {
    const Hierarchy& h = store.hierarchy;
    const Node& node = h.nodes[index];
    const bool isSample = most != std::numeric_limits<uint64_t>::max();
    std::vector<Disc> overview;
    if (!isSample || node.isLeaf() || isAboveLeaves(h, node))
        addDiscs(h, node, chunk, 0, overviewOf(h, node, chunk), 1, overview);
    STIPPLE_ASSIGN(const uint64_t far, measureFew(store, index, overview));
    if (node.isLeaf() || (isSample && !isAboveLeaves(h, node))) return far;
    // Clusters are cells of keys, which are as deep as a build needs, but 21 levels at least.
    uint32_t level = std::min(node.level + kClusterLevels, h.rootLog2);
    if (!isAboveLeaves(h, node)) {
        const auto discs =
            discsOf(h, node, chunk, std::exp2(static_cast<double>(h.rootLog2) - level), overviewOf(h, node, chunk));
        STIPPLE_ASSIGN(const uint64_t few, measureFew(store, index, discs));
        return far + few;
    }
    const uint32_t least = std::min(level, 21u);
    for (; level > least; --level)
        if (const auto measured = measureErrorsAt(store, index, chunk, most, level)) return far + *measured;
    STIPPLE_ASSIGN(const uint64_t measured, measureErrorsAt(store, index, chunk, most, level));
    return far + measured;
}

namespace {

constexpr uint32_t kNearSteps = 6;    ///< as a power of two: points in one cell of so many steps lie near each other
constexpr size_t kFewNearPlaces = 8;  ///< that may lie in one

/// Fast: false if no cell holds more than a few. Several cells are counted as one.
bool mayBeCrowded(std::span<const shared::PointRecord> records) {
    constexpr uint32_t kBits = 15;
    std::vector<uint8_t> counts(size_t{1} << kBits);
    for (const shared::PointRecord& r : records) {
        const uint32_t cell = (shared::recordX(r) >> kNearSteps) | (shared::recordY(r) >> kNearSteps) << 10 |
                              (shared::recordZ(r) >> kNearSteps) << 20;
        if (++counts[cell * 0x9e3779b1u >> (32 - kBits)] > kFewNearPlaces) return true;
    }
    return false;
}

}  // namespace

Result<void> checkDrawnPlaces(const Store& store, uint32_t index, const Chunk& chunk) {
    constexpr size_t kMany = 64, kShare = 4;
    const Hierarchy& h = store.hierarchy;
    const Payload& payload = h.payload(index);
    const size_t first = overviewOf(h, payload, chunk);
    if (chunk.lowBits.empty() || !mayBeCrowded(std::span(chunk.records).subspan(first))) return {};
    using Stored = std::array<uint64_t, 3>;         // within the node's cell
    std::vector<std::pair<Stored, Stored>> places;  // where it is near others, and itself
    double off = 0;
    for (size_t i = first; i < chunk.records.size(); ++i) {
        const shared::PointRecord& r = chunk.records[i];
        const Stored steps{shared::recordX(r), shared::recordY(r), shared::recordZ(r)};
        std::pair<Stored, Stored> at;
        glm::dvec3 from(0);
        for (size_t a = 0; a < 3; ++a) {
            at.first.at(a) = steps.at(a) >> kNearSteps;
            at.second.at(a) = steps.at(a) << payload.stepShift | chunk.lowBits[3 * i + a];
            from[static_cast<int>(a)] = double(chunk.lowBits[3 * i + a]) - 0.5 * (std::exp2(payload.stepShift) - 1);
        }
        off = std::max(off, glm::length(from));
        places.push_back(at);
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    size_t coarse = 0;
    for (size_t begin = 0, end = 0; begin < places.size(); begin = end) {
        for (end = begin + 1; end < places.size() && places[end].first == places[begin].first;) ++end;
        coarse += end - begin > kFewNearPlaces ? end - begin : 0;
    }
    if (coarse <= kMany && coarse * kShare <= places.size()) return {};
    return fail(ErrorKind::input,
                fmt::format("{} points are drawn up to {:.3g} units off where they are stored, within {:.3g} units of "
                            "others, and their error says 0",
                            coarse, h.unit * off, h.unit * std::exp2(payload.stepShift + double{kNearSteps})),
                fmt::format("{}: node {}", store.path, h.nodeOf(index)), "build it again with this program");
}

namespace {

using Corners = std::array<glm::dvec3, 3>;

void appendTriangles(const Node& node, const Chunk& chunk, uint32_t firstCluster, uint32_t clusters,
                     std::vector<Corners>& to) {
    for (uint32_t c = firstCluster; c < firstCluster + clusters; ++c) {
        const shared::MeshCluster& cluster = chunk.clusters[c];
        for (uint32_t t = 0; t < cluster.counts >> 16; ++t) {
            const uint32_t packed = chunk.triangles[cluster.firstTriangle + t];
            Corners corners;
            for (uint32_t k = 0; k < 3; ++k)
                corners.at(k) = vertexPlace(node, chunk, cluster, packed >> (8 * k) & 255u);
            to.push_back(corners);
        }
    }
}

/// Largest distance of a few corners of `from` from the triangles `to`.
double farthestCorner(const std::vector<Corners>& from, const std::vector<Corners>& to) {
    constexpr size_t kCorners = 24;
    double worst = 0;
    // Balls around the triangles: what is farther than the nearest so far is not looked at.
    std::vector<glm::dvec4> balls;
    balls.reserve(to.size());
    for (const auto& [a, b, c] : to) {
        const glm::dvec3 m = (a + b + c) * (1.0 / 3);
        balls.emplace_back(m, 1.000001 * std::max({glm::length(a - m), glm::length(b - m), glm::length(c - m)}));
    }
    for (size_t k = 0; k < kCorners; ++k) {
        const glm::dvec3& p = from[k * from.size() / kCorners].at(k % 3);
        double nearest = 1e300;
        for (size_t i = 0; i < to.size(); ++i) {
            const glm::dvec3 off = p - glm::dvec3(balls[i]);
            const double reach = nearest + balls[i].w;
            if (glm::dot(off, off) > reach * reach) continue;
            const auto& [a, b, c] = to[i];
            const glm::dvec2 w = closestWeights(p, a, b, c);
            nearest = std::min(nearest, glm::length(p - (a + w.x * (b - a) + w.y * (c - a))));
        }
        worst = std::max(worst, nearest);
    }
    return worst;
}

}  // namespace

Result<uint64_t> measureGroup(const Store& store, uint32_t index, const Chunk& chunk) {
    const Hierarchy& h = store.hierarchy;
    const MeshGroup& group = h.groups[index];
    std::vector<Corners> fine, coarse;
    appendTriangles(h.nodes[index], chunk, 0, group.clusters, fine);
    for (uint32_t p = group.firstParent; p < group.firstParent + group.parents; ++p) {
        const MeshGroup& parent = h.groups[h.parents[p]];
        STIPPLE_ASSIGN(const Chunk above, readChunk(store, h.parents[p]));
        for (uint32_t r = parent.firstRun; r < parent.firstRun + parent.runs; ++r)
            if (h.runs[r].producer == index)
                appendTriangles(h.nodes[h.parents[p]], above, h.runs[r].firstCluster, h.runs[r].clusters, coarse);
    }
    if (coarse.empty() || fine.empty()) return 0;
    const double error = h.errors.decode(h.nodes[index].errorCode);
    const double off = std::max(farthestCorner(fine, coarse), farthestCorner(coarse, fine));
    // Distances are measured in fp32 when it is built. (The last code stands for whatever the scale does not reach.)
    if (h.nodes[index].errorCode == ErrorScale::kLargest) return fine.size() + coarse.size();
    if (off <= error * (1 + 1e-5) + 1e-6 * h.nodes[index].radius) return fine.size() + coarse.size();
    return fail(
        ErrorKind::input,
        fmt::format("a simplification is {:.6g} lattice units off its triangles, its error says {:.6g}", off, error),
        fmt::format("{}: group {}", store.path, index),
        "this is a fault of the build; please report it with the input");
}

namespace {

struct Curve {
    glm::dvec3 a, b;
    double radiusA = 0, radiusB = 0;
    uint32_t code = 0;
};
std::vector<Curve> curvesOf(const Hierarchy& h, const Node& node, const Chunk& chunk) {
    const double step = std::exp2(node.stepShift);
    const auto edge = static_cast<float>(h.cellSize(node));
    const auto placeOf = [&](const shared::CurveVertex& v) {
        return h.recordOrigin(node) +
               step * glm::dvec3(v.positionXY & 0xffffu, v.positionXY >> 16, v.positionZ & 0xffffu);
    };
    std::vector<Curve> out;
    for (const shared::CurveSegment& s : chunk.segments)
        out.push_back({placeOf(s.a), placeOf(s.b), double{shared::curveRadius(s.a, edge)},
                       double{shared::curveRadius(s.b, edge)}, shared::segmentErrorCode(s)});
    return out;
}

/// How far the ball at p is from the nearest ball of a segment, at most.
double distanceOf(const Curve& s, const glm::dvec3& p, double radius) {
    const glm::dvec3 d = s.b - s.a;
    const double u = std::clamp(glm::dot(p - s.a, d) / std::max(glm::dot(d, d), 1e-300), 0.0, 1.0);
    return glm::length(p - s.a - u * d) + std::abs(radius - (s.radiusA + u * (s.radiusB - s.radiusA)));
}

}  // namespace

Result<uint64_t> measureCurves(const Store& store, uint32_t index, const Chunk& chunk) {
    constexpr size_t kMeasured = 48;
    const Hierarchy& h = store.hierarchy;
    const Node& node = h.nodes[index];
    const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
    if (!isAboveLeaves(h, node)) return 0;
    std::vector<Curve> leaves;
    double steps = std::exp2(node.stepShift);
    for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
        STIPPLE_ASSIGN(const Chunk below, readChunk(store, c));
        const std::vector<Curve> more = curvesOf(h, h.nodes[c], below);
        leaves.insert(leaves.end(), more.begin(), more.end());
        if (c == node.firstChild) steps += std::exp2(h.nodes[c].stepShift);
    }
    const std::vector<Curve> curves = curvesOf(h, node, chunk);
    const size_t stride = curves.size() / kMeasured + 1;
    uint64_t measured = 0;
    for (size_t i = 0; i < curves.size(); i += stride, ++measured) {
        const Curve& s = curves[i];
        for (const double u : {0.0, 0.5, 1.0}) {
            const glm::dvec3 p = glm::mix(s.a, s.b, u);
            const double radius = glm::mix(s.radiusA, s.radiusB, u);
            double off = 1e300;
            for (const Curve& leaf : leaves) off = std::min(off, distanceOf(leaf, p, radius));
            // Places are rounded to steps and radii to a 256th, in both.
            const double rounding = 0.5 * std::sqrt(3.0) * steps + radius / 64, error = h.errors.decode(s.code);
            if (off <= error * (1 + 1e-5) + rounding) continue;
            return fail(
                ErrorKind::input,
                fmt::format("a segment is {:.6g} lattice units off the leaves, its error says {:.6g}", off, error),
                fmt::format("{}: node {}", store.path, index),
                "this is a fault of the build; please report it with the input");
        }
    }
    return measured;
}

}  // namespace stipple::lod
