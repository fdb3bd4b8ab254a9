#include "lod/builder/curves/curve_cell.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "lod/builder/octree/packed.h"
#include "lod/primitives/octahedral.h"
#include "lod/store/chunk.h"
#include "lod/store/pruning.h"

namespace stipple::lod {
namespace {

constexpr double kStepsPerTolerance = 64;  ///< a node's tolerance is its cell / this
constexpr size_t kMostFactor = 4;          ///< parts of a node before it is pruned / those of a leaf

struct CurveNode {
    Node node;
    Key key = 0;
    double kept = 1;  ///< share of the curves that the node draws, by area
    std::vector<CurvePart> parts;
};

class CurveCell {
  public:
    CurveCell(const WorkCell& cell, const Frame& frame, uint32_t leafSegments, const Fineness& fineness,
              const CurveDivision& division)
        : frame_(frame), leafSegments_(leafSegments), fineness_(fineness), division_(division) {
        nodes_.push_back(nodeAt(static_cast<uint32_t>(cell.level), cell.key));
    }

    Result<void> takeInput(const std::vector<uint8_t>& bytes) {
        CurveRuns in;
        ByteReader from(bytes);
        while (!from.isWhole())
            if (!in.get(from)) return damaged();
        struct Run {
            CurveRun run;
            size_t at;
        };
        std::vector<Run> order;
        size_t at = 0;
        for (const CurveRun& run : in.runs) {
            order.push_back({run, at});
            at += run.points;
        }
        std::sort(order.begin(), order.end(), [](const Run& a, const Run& b) {
            return std::tie(a.run.curve, a.run.firstNumber) < std::tie(b.run.curve, b.run.firstNumber);
        });
        for (const auto& [run, begin] : order) takeRun(run, &in.points[begin]);
        if (longestOf(nodes_[0]) > frame_.cellSize(nodes_[0].node.level))
            return fail(ErrorKind::input, "a segment is far longer than the many others that lie around it", "",
                        "give it vertices where it passes them");
        partition();
        return {};
    }

    Result<void> takeBelow(const std::vector<FromBelow>& below) {
        for (const FromBelow& child : below) {
            ByteReader from(child.bytes);
            CurveNode node;
            std::vector<CurvePoint> points;
            from.get(node.node);
            from.get(node.key);
            from.get(node.kept);
            CurveRuns ends;  // (every end of a part is a point that travelled before)
            if (!getPacked(from, node.parts) || !ends.get(from) || !from.isWhole()) return damaged();
            size_t next = 0;
            for (const CurveRun& run : ends.runs)
                for (uint32_t k = 0; k < run.points; ++k) {
                    points.push_back(ends.points[next++].point());
                    points.back().curve = run.curve;
                    points.back().number = run.firstNumber;
                    points.back().isRibbon = run.isRibbon;
                }
            const auto base = static_cast<uint32_t>(points_.size());
            for (CurvePart& p : node.parts) {
                p.a += base;
                p.b += base;
            }
            points_.insert(points_.end(), points.begin(), points.end());
            nodes_.push_back(std::move(node));
        }
        // In octant order. One point may have come from several octants: parts are joined where they share it.
        std::sort(nodes_.begin() + 1, nodes_.end(),
                  [](const CurveNode& a, const CurveNode& b) { return a.key < b.key; });
        uniteEqualPoints();
        nodes_[0].node.firstChild = 1;
        for (size_t c = 1; c < nodes_.size(); ++c) nodes_[0].node.childMask |= octantOf(nodes_[c].node);
        firstOwn_ = nodes_.size();
        return {};
    }

    CellProduct run(bool isLast) {
        for (size_t i = std::max<size_t>(nodes_.size(), 1); i-- > 0;)
            if (i == 0 || firstOwn_ == 0) makeNode(static_cast<uint32_t>(i));
        CellProduct out;
        CurveTable table;
        for (size_t i = nodes_.size(); i-- > (isLast ? 0u : 1u);) write(nodes_[i], table);
        table.fewestKept = nodes_[0].kept;
        out.chunks = std::move(table.batch.bytes);
        ByteWriter to;
        table.put(to);
        out.table = to.bytes();
        if (!isLast) out.up.push_back({keyAbove(), goingUp()});
        return out;
    }

  private:
    static tl::unexpected<Error> damaged() {
        return fail(ErrorKind::input, "a temporary file is not what was written", "", "build again");
    }
    static uint8_t octantOf(const Node& n) {
        return static_cast<uint8_t>(1u << ((n.cell[0] & 1u) | (n.cell[1] & 1u) << 1 | (n.cell[2] & 1u) << 2));
    }

    /// The pieces of a run that lie in the cell.
    void takeRun(const CurveRun& run, const TravellingPoint* points) {
        const CurveNode& own = nodes_[0];
        const uint32_t shift = frame_.shiftOf(own.node.level);
        uint32_t number = run.firstNumber;
        for (uint32_t i = 1; i < run.points; ++i) {
            const bool isGraded = division_.divide(points[i - 1], points[i], ends_);
            TravellingPoint before = points[i - 1];
            for (size_t k = 0; k < ends_.size(); ++k) {
                const TravellingPoint& end = ends_[k];
                const Key key = frame_.keyOf(TravellingPoint::middle(before, end));
                if (key >> shift == own.key >> shift) {
                    CurvePart part;
                    part.a = addPoint(before, run, number, isGraded && k > 0);
                    part.b = addPoint(end, run, number + 1, isGraded && k + 1 < ends_.size());
                    part.radiusA = points_[part.a].radius;
                    part.radiusB = points_[part.b].radius;
                    part.colourA = points_[part.a].colour;
                    part.colourB = points_[part.b].colour;
                    nodes_[0].parts.push_back(part);
                }
                before = end;
                ++number;
            }
        }
    }
    uint32_t addPoint(const TravellingPoint& from, const CurveRun& run, uint32_t number, bool isFarFromAll) {
        const bool isThere = !points_.empty() && points_.back().curve == run.curve && points_.back().number == number;
        if (!isThere) {
            CurvePoint p = from.point();
            p.curve = run.curve;
            p.number = number;
            p.isRibbon = run.isRibbon;
            p.isFarFromAll = isFarFromAll;
            points_.push_back(p);
            places_.push_back(from.steps());
        }
        return static_cast<uint32_t>(points_.size() - 1);
    }

    CurveNode nodeAt(uint32_t level, Key key) const {
        CurveNode n;
        n.key = key;
        n.node.level = static_cast<uint8_t>(level);
        const Key cell = key >> frame_.shiftOf(level);
        n.node.cell = {compactBits(cell), compactBits(cell >> 1), compactBits(cell >> 2)};
        n.node.stepShift = static_cast<int8_t>(static_cast<int>(frame_.rootLog2) - static_cast<int>(level) - 15);
        return n;
    }

    double longestOf(const CurveNode& node) const {
        double longest = 0;
        for (const CurvePart& p : node.parts) longest = std::max(longest, glm::length(points_[p.b].p - points_[p.a].p));
        return longest;
    }
    bool hasVertices(const CurveNode& node) const {
        return std::any_of(node.parts.begin(), node.parts.end(), [&](const CurvePart& p) {
            return !points_[p.a].isFarFromAll || !points_[p.b].isFarFromAll;
        });
    }

    /// Are the ends of many of its segments drawn to steps that can be seen?
    bool isCoarse(const CurveNode& node) const {
        constexpr size_t kShare = 16;
        const double step = curveStep(frame_.cellSize(node.node.level));
        if (step <= TravellingPoint::rounding()) return false;
        size_t coarse = 0;
        for (const CurvePart& p : node.parts) {
            const double length = glm::length(points_[p.b].p - points_[p.a].p);
            coarse += fineness_.isCoarse(step, detailOf(double{std::max(p.radiusA, p.radiusB)}, length)) ? 1 : 0;
        }
        return coarse * kShare > node.parts.size();
    }

    /// An octree of the segments' middles, breadth first.
    void partition() {
        for (size_t i = 0; i < nodes_.size(); ++i) {
            const uint32_t level = nodes_[i].node.level;
            if (level >= frame_.keyLevels || (nodes_[i].parts.size() <= leafSegments_ && !isCoarse(nodes_[i])) ||
                longestOf(nodes_[i]) > frame_.cellSize(level + 1))
                continue;
            const uint32_t bit = frame_.rootLog2 - level - 1;
            std::array<std::vector<CurvePart>, 8> parts;
            for (const CurvePart& p : nodes_[i].parts) {
                const Place middle = TravellingPoint::middle(places_[p.a], places_[p.b]);
                size_t octant = 0;
                for (size_t a = 0; a < 3; ++a) octant |= (middle.at(a) >> bit & 1u) << a;
                parts.at(octant).push_back(p);
            }
            nodes_[i].node.firstChild = static_cast<uint32_t>(nodes_.size());
            nodes_[i].parts = {};
            for (uint64_t octant = 0; octant < 8; ++octant) {
                if (parts.at(octant).empty()) continue;
                nodes_[i].node.childMask |= static_cast<uint8_t>(1u << octant);
                CurveNode child = nodeAt(level + 1, nodes_[i].key | Key{octant} << frame_.shiftOf(level + 1));
                child.parts = std::move(parts.at(octant));
                nodes_.push_back(std::move(child));
            }
        }
        places_ = {};
    }

    void uniteEqualPoints() {
        std::vector<uint32_t> order(points_.size()), place(points_.size());
        for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
        const auto idOf = [&](uint32_t i) { return std::pair(points_[i].curve, points_[i].number); };
        std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return idOf(a) < idOf(b); });
        std::vector<CurvePoint> unique;
        for (size_t i = 0; i < order.size(); ++i) {
            if (i == 0 || idOf(order[i]) != idOf(order[i - 1])) unique.push_back(points_[order[i]]);
            place[order[i]] = static_cast<uint32_t>(unique.size() - 1);
        }
        points_ = std::move(unique);
        for (CurveNode& node : nodes_)
            for (CurvePart& p : node.parts) {
                p.a = place[p.a];
                p.b = place[p.b];
            }
    }

    Key keyAbove() const {
        const uint32_t level = nodes_[0].node.level;
        const uint32_t shift = frame_.shiftOf(level - 1);
        return nodes_[0].key >> shift << shift;
    }

    std::vector<uint8_t> goingUp() const {
        CurveNode node = nodes_[0];
        std::vector<uint32_t> place(points_.size(), ~0u);
        CurveRuns ends;
        for (CurvePart& p : node.parts)
            for (uint32_t* end : {&p.a, &p.b}) {
                if (place[*end] == ~0u) {
                    const CurvePoint& point = points_[*end];
                    place[*end] = static_cast<uint32_t>(ends.points.size());
                    ends.points.emplace_back(point);
                    ends.runs.push_back({point.curve, point.number, 1, point.isRibbon});
                }
                *end = place[*end];
            }
        ByteWriter to;
        to.put(node.node);
        to.put(node.key);
        to.put(node.kept);
        putPacked(node.parts, to);
        ends.put(to);
        return to.bytes();
    }

    void write(CurveNode& node, CurveTable& table) const {
        std::vector<uint32_t> parentCodes, ownCodes;
        const std::vector<uint8_t> bytes = encode(node, parentCodes, ownCodes);
        NodeBatch::Written w;
        w.node = node.node;
        w.key = node.key;
        w.node.chunkOffset = table.batch.bytes.size();
        w.node.chunkBytes = static_cast<uint32_t>(bytes.size());
        w.node.chunkHash = hashBytes(bytes.data(), bytes.size());
        w.node.attributeHash = hashBytes(nullptr, 0);
        w.firstCount = static_cast<uint32_t>(table.batch.counts.size());
        for (const auto& [codes, count] : {std::pair{&parentCodes, &w.parentCodes}, std::pair{&ownCodes, &w.ownCodes}})
            for (uint32_t c = 0; c < 256; ++c)
                if ((*codes)[c] > 0) {
                    table.batch.addCount(c, (*codes)[c]);
                    ++*count;
                }
        table.batch.bytes.insert(table.batch.bytes.end(), bytes.begin(), bytes.end());
        table.batch.nodes.push_back(w);
        if (node.node.isLeaf() && hasVertices(node))
            table.rounding = std::max(
                table.rounding, std::exp2(node.node.stepShift) * 0.5 * std::sqrt(3.0) + TravellingPoint::rounding());
        node.parts = {};
    }

    void makeNode(uint32_t index) {
        CurveNode& node = nodes_[index];
        Node& out = node.node;
        const double cell = frame_.cellSize(out.level);
        if (!out.isLeaf()) {
            struct Child {
                uint32_t node, part;
            };
            std::vector<Child> from;
            const auto children = static_cast<uint32_t>(__builtin_popcount(out.childMask));
            for (uint32_t c = out.firstChild; c < out.firstChild + children; ++c)
                for (uint32_t k = 0; k < nodes_[c].parts.size(); ++k) from.push_back({c, k});
            const auto partOf = [&](const Child& c) -> CurvePart& { return nodes_[c.node].parts[c.part]; };
            std::sort(from.begin(), from.end(), [&](const Child& a, const Child& b) {
                const CurvePoint &p = points_[partOf(a).a], &q = points_[partOf(b).a];
                return p.curve != q.curve ? p.curve < q.curve : p.number < q.number;
            });
            std::vector<CurvePart> parts;
            for (const Child& c : from) {
                parts.push_back(partOf(c));
                const auto& at = nodes_[c.node].node.cell;
                parts.back().octants =
                    static_cast<uint8_t>(1u << ((at[0] & 1u) | (at[1] & 1u) << 1 | (at[2] & 1u) << 2));
            }
            CurveMerge merge = mergeParts(
                points_, parts,
                {cell / kStepsPerTolerance, std::exp2(out.stepShift), kThinCurve * cell, kMostFactor * leafSegments_});
            for (CurvePart& p : merge.parts) p.ownCode = static_cast<uint8_t>(frame_.errors.encodeUp(p.error));
            const auto common = static_cast<uint8_t>(frame_.errors.encodeUp(merge.commonError));
            for (size_t i = 0; i < from.size(); ++i)
                partOf(from[i]).parentCode =
                    merge.standsFor[i] == kPruned ? common : merge.parts[merge.standsFor[i]].ownCode;
            node.parts = std::move(merge.parts);
            node.kept = 1;
            for (uint32_t c = out.firstChild; c < out.firstChild + children; ++c)
                node.kept = std::min(node.kept, nodes_[c].kept);
            node.kept *= merge.kept;
            out.normalConeCosine = static_cast<float>(node.kept);
        }
        out.records = static_cast<uint32_t>(node.parts.size());
        for (const CurvePart& p : node.parts) out.errorCode = std::max(out.errorCode, p.ownCode);
        makeSphere(index);
    }

    void makeSphere(uint32_t index) {
        CurveNode& node = nodes_[index];
        Node& out = node.node;
        glm::dvec3 lo(1e300), hi(-1e300);
        const auto children = static_cast<uint32_t>(out.isLeaf() ? 0 : __builtin_popcount(out.childMask));
        for (uint32_t c = out.firstChild; c < out.firstChild + children; ++c) {
            lo = glm::min(lo, nodes_[c].node.centre - nodes_[c].node.radius);
            hi = glm::max(hi, nodes_[c].node.centre + nodes_[c].node.radius);
        }
        const auto forEnds = [&](const auto& use) {
            for (const CurvePart& p : node.parts) {
                use(points_[p.a].p, double{p.radiusA});
                use(points_[p.b].p, double{p.radiusB});
            }
        };
        forEnds([&](const glm::dvec3& p, double r) {
            lo = glm::min(lo, p - r);
            hi = glm::max(hi, p + r);
        });
        out.centre = 0.5 * (lo + hi);
        for (uint32_t c = out.firstChild; c < out.firstChild + children; ++c)
            out.radius = std::max(out.radius, glm::length(nodes_[c].node.centre - out.centre) + nodes_[c].node.radius);
        // Positions are rounded to steps, radii to 1/256.
        const double step = std::exp2(out.stepShift);
        forEnds([&](const glm::dvec3& p, double r) {
            out.radius = std::max(out.radius, glm::length(p - out.centre) + r * (1 + 1.0 / 128) + step);
        });
        out.radius *= 1 + 1e-6;
    }

    std::vector<uint8_t> encode(const CurveNode& node, std::vector<uint32_t>& parentCodes,
                                std::vector<uint32_t>& ownCodes) const {
        const Node& out = node.node;
        parentCodes.assign(256, 0);
        ownCodes.assign(256, 0);
        std::vector<const CurvePart*> order;
        for (const CurvePart& p : node.parts) {
            ++parentCodes[p.parentCode];
            ++ownCodes[p.ownCode];
            order.push_back(&p);
        }
        std::stable_sort(order.begin(), order.end(),
                         [](const CurvePart* a, const CurvePart* b) { return a->parentCode > b->parentCode; });
        const double step = std::exp2(out.stepShift), cell = frame_.cellSize(out.level);
        const glm::dvec3 base =
            (glm::dvec3(out.cell[0], out.cell[1], out.cell[2]) - double{shared::kCurveMargin}) * cell;
        Chunk chunk;
        const auto vertex = [&](uint32_t i, float wide, uint32_t colour) {
            const CurvePoint& p = points_[i];
            const glm::dvec3 exact = glm::floor((p.p - base) / step + 0.5);
            const glm::dvec3 q = glm::clamp(exact, glm::dvec3(0), glm::dvec3(65535));
            STIPPLE_CHECK(glm::length(q - exact) < 4, "an end outside of its node");
            const uint32_t radius = shared::curveRadiusCode(static_cast<float>(wide / cell));
            return shared::CurveVertex{static_cast<uint32_t>(q.x) | static_cast<uint32_t>(q.y) << 16,
                                       static_cast<uint32_t>(q.z) | radius << 16, octEncode(p.direction),
                                       colour & 0xffffffu};
        };
        for (const CurvePart* p : order) {
            shared::CurveSegment s{vertex(p->a, p->radiusA, p->colourA), vertex(p->b, p->radiusB, p->colourB)};
            if (points_[p->a].isRibbon == 0) s.a.positionZ |= 0x80000000u;
            s.a.colour |= uint32_t{p->ownCode} << 24;
            s.b.colour |= uint32_t{p->octants} << 24;
            chunk.segments.push_back(s);
        }
        return encodeCurveChunk(chunk);
    }

    const Frame& frame_;
    const uint32_t leafSegments_;
    const Fineness fineness_;
    const CurveDivision& division_;
    std::vector<CurvePoint> points_;
    std::vector<Place> places_;     ///< of a subtree's points, as they travelled
    std::vector<CurveNode> nodes_;  ///< the first one is the cell's own
    std::vector<TravellingPoint> ends_;
    size_t firstOwn_ = 0;  ///< 0: all nodes are to be made
};

}  // namespace

Result<CellProduct> buildCurveCell(const WorkCell& cell, const std::vector<uint8_t>& input,
                                   const std::vector<FromBelow>& below, const Frame& frame, uint32_t leafSegments,
                                   const Fineness& fineness, const CurveDivision& division) {
    CurveCell work(cell, frame, leafSegments, fineness, division);
    if (cell.subtree != WorkCell::kNone) {
        STIPPLE_TRY(work.takeInput(input));
    } else {
        STIPPLE_TRY(work.takeBelow(below));
    }
    return work.run(cell.level == 0);
}

void CurveTable::put(ByteWriter& to) const {
    to.put(batch.nodes);
    to.put(batch.counts);
    to.put(rounding);
    to.put(fewestKept);
}
bool CurveTable::get(ByteReader& from) {
    from.get(batch.nodes);
    from.get(batch.counts);
    from.get(rounding);
    from.get(fewestKept);
    return from.isWhole();
}

}  // namespace stipple::lod
