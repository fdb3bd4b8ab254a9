#include "lod/builder/points/overview.h"

#include <algorithm>
#include <cmath>

#include "lod/builder/points/aggregate.h"
#include "lod/builder/points/aggregate_values.h"
#include "lod/builder/points/covered.h"

namespace stipple::lod {
namespace {

constexpr double kBefore = 0.5;     ///< of the way from a cell's middle to the front of what it holds: where a face is
constexpr double kLeastFace = 0.4;  ///< of the largest: what shows less has no face of its own
constexpr size_t kFewestRecords = 64;  ///< that are worth an overview
constexpr double kMostCount = 0x1p18;  ///< of a part: sums of 8,192 fit into 32 bits
constexpr size_t kFewer = 2;  ///< a level has so many times fewer records than the next finer one, or there is none

constexpr size_t kAxes = 3, kTwoSided = 2 * kAxes, kNowhere = 3 * kAxes, kWays = kNowhere + 1;
/// The way a record's normal looks: along an axis, one of six; where it has no sign one of three; or it has none.
size_t wayOf(const AggregateRecord& r) {
    if ((r.flags & shared::kFlagNoNormal) != 0) return kNowhere;
    const glm::vec3 size = glm::abs(r.normal);
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    if ((r.flags & shared::kFlagTwoSided) != 0) return kTwoSided + static_cast<size_t>(axis);
    return 2 * static_cast<size_t>(axis) + (r.normal[axis] < 0 ? 1 : 0);
}

/// Records of a level, and values of their attributes.
struct Records {
    std::vector<AggregateRecord> records;
    std::vector<AggregateValue> values;
    void append(const Records& more) {
        records.insert(records.end(), more.records.begin(), more.records.end());
        values.insert(values.end(), more.values.begin(), more.values.end());
    }
};
/// Leaves lie denser where a scanner was near, which is no reason to see more of them: the parts that levels are made
/// of count by their areas, as if they were surfaces. So means are by area, but those of attributes.
struct Level {
    PendingNode parts;  ///< of the next coarser one: one for each way
    Records drawn;
};
/// Area of a part that counts 1, where the root's own records lie in cells of that size.
double unitArea(double cell) { return cell * cell / 256; }

/// Of a part's area, how much is seen from where a face looks, which is along an axis or against it.
double shareOf(const AggregateRecord& part, int axis, float sign) {
    constexpr double kOfBall = 0.5;  // as the mean of discs
    if ((part.flags & shared::kFlagNoNormal) != 0) return kOfBall;
    const auto along = static_cast<double>(sign * part.normal[axis]);
    return (part.flags & shared::kFlagTwoSided) != 0 ? std::abs(along) : std::max(along, 0.0);
}

/// What becomes of cells.
class OverviewCells {
  public:
    OverviewCells(const Frame& frame, double unit, const PendingNode& below)
        : frame_(frame), unit_(unit), below_(below) {}
    /// Of the parts [begin, end), which lie in one cell.
    void merge(size_t begin, size_t end, const Around& around, Level& out) {
        for (Records& of : ways_) of = {};
        const size_t kinds = frame_.attributes.size();
        for (size_t k = begin; k < end; ++k) {
            Records& of = ways_.at(wayOf(below_.records[k]));
            of.records.push_back(below_.records[k]);
            const auto first = below_.values.begin() + static_cast<ptrdiff_t>(k * kinds);
            of.values.insert(of.values.end(), first, first + static_cast<ptrdiff_t>(kinds));
        }
        size_t ways = 0;
        PendingNode& parts = out.parts;
        for (size_t way = 0; way < kWays; ++way) {
            const Records& of = ways_.at(way);
            if (of.records.empty()) continue;
            mergeAggregates(around.grid, of.records, nullptr, around, parts.records.emplace_back());
            appendMerged(of.values, parts.values);
            ++ways;
        }
        if (ways == 1) {
            out.drawn.records.push_back(parts.records.back());
            out.drawn.values.insert(out.drawn.values.end(), parts.values.end() - static_cast<ptrdiff_t>(kinds),
                                    parts.values.end());
            return;
        }
        const glm::dvec3 middle = middleOf(begin, end);
        std::array<double, 2 * kAxes> seen{};
        for (size_t face = 0; face < seen.size(); ++face)
            for (size_t k = begin; k < end; ++k)
                seen.at(face) +=
                    unit_ * below_.records[k].count * shareOf(below_.records[k], axisOf(face), signOf(face));
        const double most = *std::max_element(seen.begin(), seen.end());
        const auto isKept = [&](size_t face) { return seen.at(face) >= kLeastFace * most; };
        // From where an axis without a face looks, the others are seen edgewise: they must not look away as well.
        bool lacksAxis = false;
        for (size_t face = 0; face < seen.size(); face += 2) lacksAxis |= !isKept(face) && !isKept(face + 1);
        const auto all = std::span(below_.records).subspan(begin, end - begin);
        const auto values = std::span(below_.values).subspan(begin * kinds, (end - begin) * kinds);
        for (size_t face = 0; face < seen.size(); ++face) {
            if (!isKept(face)) continue;
            AggregateRecord& record = out.drawn.records.emplace_back();
            putFace(all, around, middle, face, seen.at(face), lacksAxis && isKept(face ^ 1u), record);
            appendMerged(values, out.drawn.values);
        }
    }

  private:
    /// Mean by area.
    glm::dvec3 middleOf(size_t begin, size_t end) const {
        const glm::dvec3 first = below_.records[begin].mean;
        glm::dvec3 sum(0);
        double count = 0;
        for (size_t k = begin; k < end; ++k) {
            const AggregateRecord& p = below_.records[k];
            sum += static_cast<double>(p.count) * (p.mean - first);
            count += p.count;
        }
        return first + sum / count;
    }
    static int axisOf(size_t face) { return static_cast<int>(face / 2); }
    static float signOf(size_t face) { return face % 2 == 0 ? 1.0f : -1.0f; }
    /// A disc for those who look along a face's axis, who see so much of the parts: as wide as a square's corners.
    void putFace(std::span<const AggregateRecord> parts, const Around& around, glm::dvec3 place, size_t face,
                 double area, bool isTwoSided, AggregateRecord& out) const {
        const int axis = axisOf(face);
        const double sign = signOf(face);
        double front = sign * place[axis];
        for (const AggregateRecord& p : parts) front = std::max(front, sign * p.place[axis]);
        place[axis] += kBefore * (sign * front - place[axis]);
        place = insideOf(below_.node, place, around.grid.step);
        glm::vec3 normal(0);
        normal[axis] = signOf(face);
        mergeAtFace(around.grid, parts, around,
                    {place, std::sqrt(0.5 * area), normal, isTwoSided, 2 * below_.node.radius}, out);
    }
    /// Within a node's sphere, rounded to a step as well.
    static glm::dvec3 insideOf(const Node& node, const glm::dvec3& place, double step) {
        const glm::dvec3 off = place - node.centre;
        const double most = std::max(node.radius - step, 0.0), length = glm::length(off);
        return length > most ? node.centre + off * (most / length) : place;
    }
    /// A value of each attribute.
    void appendMerged(std::span<const AggregateValue> of, std::vector<AggregateValue>& to) {
        const size_t kinds = frame_.attributes.size();
        for (size_t a = 0; a < kinds; ++a) {
            column_.clear();
            for (size_t k = a; k < of.size(); k += kinds) column_.push_back(of[k]);
            to.push_back(mergeValues(frame_.attributes[a], column_));
        }
    }

    const Frame& frame_;
    double unit_;
    const PendingNode& below_;
    std::array<Records, kWays> ways_;
    std::vector<AggregateValue> column_;
};

/// Of the parts of the level below, which are in order of the cells.
Level levelOf(const Frame& frame, const RecordGrid& grid, double unit, const PendingNode& below) {
    Level out;
    out.parts.node = below.node;
    out.parts.key = below.key;
    const Around around(grid, below.key, frame.shiftOf(below.node.level), nullptr, std::span(&below, 1));
    OverviewCells cells(frame, unit, below);
    const auto cellOf = [&](size_t k) { return below.records[k].key >> grid.clusterShift; };
    for (size_t begin = 0, end = 0; begin < below.records.size(); begin = end) {
        for (end = begin + 1; end < below.records.size() && cellOf(end) == cellOf(begin);) ++end;
        cells.merge(begin, end, around, out);
    }
    measureCores(out.parts.records, around);
    return out;
}

/// What the root holds itself, points or records. No surface has much more in the cell of a record than a face of it.
PendingNode partsOf(const Frame& frame, const PendingNode& root, double cell) {
    constexpr double kMost = 1.5;
    PendingNode parts;
    parts.node = root.node;
    parts.key = root.key;
    parts.records = root.records;
    parts.values = root.values;
    const LeafPoints leaf = root.leaf();
    for (size_t k = 0; k < leaf.count(); ++k) {
        parts.records.push_back(aggregateOfLeaf(leaf.points, leaf.first + k, leaf.key[k]));
        for (size_t a = 0; a < frame.attributes.size(); ++a)
            parts.values.push_back(
                leafValue(frame.attributes[a],
                          leaf.points.attributes[a].data() + (leaf.first + k) * bytesOf(frame.attributes[a].type)));
    }
    const double mostCount = std::floor(0x1p31 / static_cast<double>(parts.records.size()));  // (sums fit)
    for (AggregateRecord& r : parts.records) {
        const auto radius = static_cast<double>(r.radius);
        const double most = r.count == 1 ? 2 * radius * radius : kMost * cell * cell;
        // A record of one leaf lies where that rounds to.
        if (r.count == 1) r.inner -= static_cast<float>(glm::length(r.mean - r.place)) * 1.000001f;
        r.count = static_cast<uint32_t>(
            std::clamp(std::min(2 * radius * radius, most) / unitArea(cell), 2.0, std::max(mostCount, 2.0)));
    }
    return parts;
}

void setCode(AggregateRecord& r, uint32_t code) {
    r.code = static_cast<uint8_t>(code);
    r.packed.positionZRadiusError = (r.packed.positionZRadiusError & 0xffffffu) | code << 24;
}

}  // namespace

void addOverview(const Frame& frame, PendingNode& root) {
    const size_t own = root.node.records;
    if (own < kFewestRecords) return;
    RecordGrid grid = gridOf(frame, root.node);
    const double cell = grid.edge / grid.cellsAcross;
    PendingNode parts = partsOf(frame, root, cell);
    Records finer{std::move(root.records), std::move(root.values)}, all;  // of the last level; of those before it
    size_t last = own;
    uint32_t error = root.node.errorCode;
    while (grid.cellsAcross > 1) {
        grid.clusterShift += 3;
        grid.cellsAcross /= 2;
        grid.cellSteps *= 2;
        Level level = levelOf(frame, grid, unitArea(cell), parts);
        const size_t fewer = grid.cellsAcross > 1 ? kFewer : 1;  // (of all in one cell there are six at most)
        if (fewer * level.drawn.records.size() >= last) continue;
        ++error;
        for (const AggregateRecord& r : level.drawn.records) error = std::max<uint32_t>(error, r.code);
        if (error >= ErrorScale::kLargest) break;  // which says of no error how large it is
        const auto code = static_cast<uint8_t>(error);
        if (last == own) std::fill(root.leafParentCode.begin(), root.leafParentCode.end(), code);
        for (AggregateRecord& r : finer.records) r.parentCode = code;
        for (AggregateRecord& r : level.drawn.records) setCode(r, error);
        all.append(finer);
        last = level.drawn.records.size();
        finer = std::move(level.drawn);
        parts = std::move(level.parts);
    }
    all.append(finer);
    root.records = std::move(all.records);
    root.values = std::move(all.values);
    root.node.records = static_cast<uint32_t>(root.leafParentCode.size() + root.records.size());
}

}  // namespace stipple::lod
