// A strand build as a straight line.
#include "lod/build/strands/strand_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "lod/build/counts.h"
#include "lod/build/strands/strand_work.h"
#include "lod/octahedral.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kRootLog2 = 24;
constexpr uint32_t kDeepest = 20;
constexpr double kStepsPerTolerance = 64;  ///< a node's tolerance is its cell / this
constexpr size_t kMostFactor = 4;          ///< parts of a node before lots are drawn / those of a leaf

struct StrandNode {
    std::array<uint32_t, 3> cell{};
    uint32_t parent = 0, firstChild = 0;
    uint8_t level = 0, childMask = 0;
    std::vector<StrandPart> parts;
    bool isLeaf() const { return childMask == 0; }
};

class StrandBuilder {
  public:
    StrandBuilder(const StrandSet& strands, const StrandBuildSettings& settings, Executor& executor)
        : strands_(strands), settings_(settings), executor_(executor) {}

    /// Points on the lattice; segments, none longer than a leaf's cell may be.
    void takeIn() {
        glm::dvec3 lo(1e300), hi(-1e300);
        for (const glm::dvec3& p : strands_.position) {
            lo = glm::min(lo, p);
            hi = glm::max(hi, p);
        }
        boundsMin = lo;
        boundsMax = hi;
        const double extent = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z, 1e-30});
        h.isStrands = true;
        h.rootLog2 = kRootLog2;
        h.unit = std::exp2(std::floor(std::log2(extent)) + 1 - kRootLog2);
        h.origin = lo;
        h.errors.smallest = std::exp2(kRootLog2 + 2.0) / std::exp2(ErrorScale::kLargest / 8.0);
        const auto toLattice = [&](uint32_t i) { return (strands_.position[i] - h.origin) / h.unit; };
        // The shortest cell for which dividing long segments does not more than double their number.
        const uint64_t segments = strands_.position.size() - strands_.strands();
        finestCell_ = std::exp2(double{kRootLog2} - kDeepest);
        const auto piecesFor = [&](double longest) {
            uint64_t pieces = 0;
            forSegments([&](size_t, uint32_t a) {
                pieces += static_cast<uint64_t>(
                    std::max(1.0, std::ceil(glm::length(toLattice(a + 1) - toLattice(a)) / longest)));
            });
            return pieces;
        };
        while (piecesFor(finestCell_) > 2 * segments) finestCell_ *= 2;
        nodes_.resize(1);
        std::vector<StrandPart>& root = nodes_[0].parts;
        for (size_t s = 0; s < strands_.strands(); ++s) {
            for (uint32_t i = strands_.first[s]; i < strands_.first[s + 1]; ++i) {
                const bool isFirst = i == strands_.first[s];
                const glm::dvec3 p = toLattice(i);
                const float radius = strands_.radius[i] / static_cast<float>(h.unit);
                if (isFirst) {
                    points_.push_back(pointOf(s, i, p, radius));
                    continue;
                }
                const StrandPoint before = points_.back(), after = pointOf(s, i, p, radius);
                const auto pieces =
                    static_cast<uint32_t>(std::max(1.0, std::ceil(glm::length(after.p - before.p) / finestCell_)));
                for (uint32_t k = 1; k <= pieces; ++k) {
                    const double u = static_cast<double>(k) / pieces;
                    StrandPoint q = after;
                    if (k < pieces) {
                        q.p = glm::mix(before.p, after.p, u);
                        q.radius = static_cast<float>((1 - u) * before.radius + u * after.radius);
                        const glm::vec3 d = glm::mix(before.direction, after.direction, static_cast<float>(u));
                        q.direction = glm::length(d) > 1e-3f ? glm::normalize(d) : before.direction;
                        q.along = before.along + u * (after.along - before.along);
                    }
                    StrandPart part;
                    part.a = static_cast<uint32_t>(points_.size() - 1);
                    part.b = part.a + 1;
                    part.radiusA = points_.back().radius;
                    part.radiusB = q.radius;
                    const uint32_t ca = strands_.colour[i - 1] & 0xffffffu, cb = strands_.colour[i] & 0xffffffu;
                    part.colourA = mixed(ca, cb, (k - 1.0) / pieces);
                    part.colourB = mixed(ca, cb, u);
                    root.push_back(part);
                    points_.push_back(q);
                }
            }
        }
        leafParts = root.size();
    }

    /// An octree of the segments' middles, breadth first.
    void partition() {
        for (size_t i = 0; i < nodes_.size(); ++i) {
            const double child = std::exp2(double{kRootLog2} - nodes_[i].level - 1);
            if (nodes_[i].parts.size() <= settings_.leafSegments || nodes_[i].level >= kDeepest || child < finestCell_)
                continue;
            std::array<std::vector<StrandPart>, 8> parts;
            for (const StrandPart& p : nodes_[i].parts) {
                const glm::dvec3 middle = 0.5 * (points_[p.a].p + points_[p.b].p);
                size_t octant = 0;
                for (int a = 0; a < 3; ++a)
                    if (middle[a] >= (2.0 * nodes_[i].cell.at(static_cast<size_t>(a)) + 1) * child) octant |= 1u << a;
                parts.at(octant).push_back(p);
            }
            nodes_[i].firstChild = static_cast<uint32_t>(nodes_.size());
            for (uint32_t octant = 0; octant < 8; ++octant) {
                if (parts.at(octant).empty()) continue;
                nodes_[i].childMask |= static_cast<uint8_t>(1u << octant);
                StrandNode node;
                node.parent = static_cast<uint32_t>(i);
                node.level = static_cast<uint8_t>(nodes_[i].level + 1);
                for (size_t a = 0; a < 3; ++a) node.cell.at(a) = 2 * nodes_[i].cell.at(a) + (octant >> a & 1u);
                node.parts = std::move(parts.at(octant));
                nodes_.push_back(std::move(node));
            }
            nodes_[i].parts = {};
        }
        h.nodes.resize(nodes_.size());
        kept_.assign(nodes_.size(), 1.0);
        for (size_t i = 0; i < nodes_.size(); ++i) {
            Node& to = h.nodes[i];
            to.parent = nodes_[i].parent;
            to.firstChild = nodes_[i].firstChild;
            to.cell = nodes_[i].cell;
            to.level = nodes_[i].level;
            to.childMask = nodes_[i].childMask;
            to.stepShift = static_cast<int8_t>(static_cast<int>(kRootLog2) - to.level - 15);
            depth_ = std::max<uint32_t>(depth_, to.level);
        }
    }

    Result<void> run(StoreWriter& writer, Progress& progress) {
        std::vector<std::vector<uint32_t>> parentCodes(nodes_.size()), ownCodes(nodes_.size());
        // Level by level from the finest: making a level fixes the parent codes of the one below, which is then
        // written.
        for (int level = static_cast<int>(depth_); level >= -1; --level) {
            forLevel(level, [&](uint32_t i) { makeNode(i); });
            std::vector<uint32_t> below;
            for (uint32_t i = 0; i < nodes_.size(); ++i)
                if (nodes_[i].level == level + 1) below.push_back(i);
            std::vector<std::vector<uint8_t>> bytes(below.size());
            executor_.parallelFor(below.size(), 1, [&](size_t begin, size_t end) {
                for (size_t k = begin; k < end; ++k)
                    bytes[k] = encode(below[k], parentCodes[below[k]], ownCodes[below[k]]);
            });
            for (size_t k = 0; k < below.size(); ++k) STIPPLE_TRY(writer.appendChunk(bytes[k], {}, h.nodes[below[k]]));
            progress.update("simplify", depth_ - static_cast<uint32_t>(std::max(level, 0)), depth_ + 1);
        }
        for (size_t i = 0; i < nodes_.size(); ++i) {
            h.nodes[i].parentCounts = makeCodeCounts(parentCodes[i], h.nodes[i].records, h.greaterThan);
            h.nodes[i].ownCounts = makeCodeCounts(ownCodes[i], h.nodes[i].records, h.greaterThan);
            if (h.nodes[i].isLeaf())
                rounding = std::max(rounding, h.unit * std::exp2(h.nodes[i].stepShift) * 0.5 * std::sqrt(3.0));
        }
        fewestKept = kept_[0];
        return {};
    }

    Hierarchy h;
    uint64_t leafParts = 0;
    double rounding = 0, fewestKept = 1;
    glm::dvec3 boundsMin{0}, boundsMax{0};

  private:
    template <typename Use>
    void forSegments(const Use& use) const {
        for (size_t s = 0; s < strands_.strands(); ++s)
            for (uint32_t i = strands_.first[s]; i + 1 < strands_.first[s + 1]; ++i) use(s, i);
    }
    template <typename Use>
    void forLevel(int level, const Use& use) {
        if (level < 0) return;
        std::vector<uint32_t> of;
        for (uint32_t i = 0; i < nodes_.size(); ++i)
            if (nodes_[i].level == level) of.push_back(i);
        executor_.parallelFor(of.size(), 1, [&](size_t begin, size_t end) {
            for (size_t k = begin; k < end; ++k) use(of[k]);
        });
    }
    static uint32_t mixed(uint32_t a, uint32_t b, double u) {
        uint32_t out = 0;
        for (uint32_t shift = 0; shift < 24; shift += 8)
            out |= static_cast<uint32_t>(std::lround((1 - u) * (a >> shift & 255u) + u * (b >> shift & 255u))) << shift;
        return out;
    }

    StrandPoint pointOf(size_t s, uint32_t i, const glm::dvec3& p, float radius) const {
        const uint32_t a = std::max(i, strands_.first[s] + 1) - 1, b = std::min(i + 1, strands_.first[s + 1] - 1);
        const glm::dvec3 chord = strands_.position[b] - strands_.position[a];
        const glm::dvec3 own = strands_.position[std::max(i, a + 1)] - strands_.position[a];
        glm::vec3 d(glm::normalize(glm::length(chord) > 1e-6 * glm::length(own) ? chord : own));
        if (strands_.isRibbon[s] != 0) {
            const glm::vec3 across = glm::cross(strands_.normal[i], d);
            d = glm::length(across) > 1e-3f
                    ? glm::normalize(across)
                    : glm::normalize(std::abs(d.x) < 0.7f ? glm::vec3(0, -d.z, d.y) : glm::vec3(-d.z, 0, d.x));
        }
        return {p, radius, d, static_cast<uint32_t>(s), static_cast<double>(i - strands_.first[s])};
    }

    void makeNode(uint32_t index) {
        StrandNode& node = nodes_[index];
        Node& out = h.nodes[index];
        const double cell = h.cellSize(out);
        if (!node.isLeaf()) {
            struct Child {
                uint32_t node, part;
            };
            std::vector<Child> from;
            const auto children = static_cast<uint32_t>(__builtin_popcount(node.childMask));
            for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c)
                for (uint32_t k = 0; k < nodes_[c].parts.size(); ++k) from.push_back({c, k});
            const auto partOf = [&](const Child& c) -> StrandPart& { return nodes_[c.node].parts[c.part]; };
            std::sort(from.begin(), from.end(), [&](const Child& a, const Child& b) {
                const StrandPoint &p = points_[partOf(a).a], &q = points_[partOf(b).a];
                return p.strand != q.strand ? p.strand < q.strand : p.along < q.along;
            });
            std::vector<StrandPart> parts;
            for (const Child& c : from) {
                parts.push_back(partOf(c));
                const auto& at = nodes_[c.node].cell;
                parts.back().octants =
                    static_cast<uint8_t>(1u << ((at[0] & 1u) | (at[1] & 1u) << 1 | (at[2] & 1u) << 2));
            }
            StrandMerge merge =
                mergeParts(points_, strands_.isRibbon, parts,
                           {cell / kStepsPerTolerance, std::exp2(out.stepShift), kMostFactor * settings_.leafSegments});
            for (StrandPart& p : merge.parts) p.ownCode = static_cast<uint8_t>(h.errors.encodeUp(p.error));
            const auto common = static_cast<uint8_t>(h.errors.encodeUp(merge.commonError));
            for (size_t i = 0; i < from.size(); ++i)
                partOf(from[i]).parentCode =
                    merge.standsFor[i] == kDrawnByLot ? common : merge.parts[merge.standsFor[i]].ownCode;
            node.parts = std::move(merge.parts);
            kept_[index] = 1;
            for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c)
                kept_[index] = std::min(kept_[index], kept_[c]);
            kept_[index] *= merge.kept;
        }
        out.records = static_cast<uint32_t>(node.parts.size());
        for (const StrandPart& p : node.parts) out.errorCode = std::max(out.errorCode, p.ownCode);
        makeSphere(index);
    }

    void makeSphere(uint32_t index) {
        const StrandNode& node = nodes_[index];
        Node& out = h.nodes[index];
        glm::dvec3 lo(1e300), hi(-1e300);
        const auto children = static_cast<uint32_t>(node.isLeaf() ? 0 : __builtin_popcount(node.childMask));
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c) {
            lo = glm::min(lo, h.nodes[c].centre - h.nodes[c].radius);
            hi = glm::max(hi, h.nodes[c].centre + h.nodes[c].radius);
        }
        const auto forEnds = [&](const auto& use) {
            for (const StrandPart& p : node.parts) {
                use(points_[p.a].p, double{p.radiusA});
                use(points_[p.b].p, double{p.radiusB});
            }
        };
        forEnds([&](const glm::dvec3& p, double r) {
            lo = glm::min(lo, p - r);
            hi = glm::max(hi, p + r);
        });
        out.centre = 0.5 * (lo + hi);
        for (uint32_t c = node.firstChild; c < node.firstChild + children; ++c)
            out.radius = std::max(out.radius, glm::length(h.nodes[c].centre - out.centre) + h.nodes[c].radius);
        // Positions are rounded to steps, radii to 1/256.
        const double step = std::exp2(out.stepShift);
        forEnds([&](const glm::dvec3& p, double r) {
            out.radius = std::max(out.radius, glm::length(p - out.centre) + r * (1 + 1.0 / 128) + step);
        });
        out.radius *= 1 + 1e-6;
    }

    std::vector<uint8_t> encode(uint32_t index, std::vector<uint32_t>& parentCodes, std::vector<uint32_t>& ownCodes) {
        StrandNode& node = nodes_[index];
        const Node& out = h.nodes[index];
        parentCodes.assign(256, 0);
        ownCodes.assign(256, 0);
        std::vector<const StrandPart*> order;
        for (const StrandPart& p : node.parts) {
            ++parentCodes[p.parentCode];
            ++ownCodes[p.ownCode];
            order.push_back(&p);
        }
        std::stable_sort(order.begin(), order.end(),
                         [](const StrandPart* a, const StrandPart* b) { return a->parentCode > b->parentCode; });
        const double step = std::exp2(out.stepShift), cell = h.cellSize(out);
        const glm::dvec3 base = h.recordOrigin(out);
        Chunk chunk;
        const auto vertex = [&](uint32_t i, float wide, uint32_t colour) {
            const StrandPoint& p = points_[i];
            const glm::dvec3 exact = glm::floor((p.p - base) / step + 0.5);
            const glm::dvec3 q = glm::clamp(exact, glm::dvec3(0), glm::dvec3(65535));
            STIPPLE_CHECK(glm::length(q - exact) < 4, "an end outside of its node");
            const uint32_t radius = shared::strandRadiusCode(static_cast<float>(wide / cell));
            return shared::StrandVertex{static_cast<uint32_t>(q.x) | static_cast<uint32_t>(q.y) << 16,
                                        static_cast<uint32_t>(q.z) | radius << 16, octEncode(p.direction),
                                        colour & 0xffffffu};
        };
        for (const StrandPart* p : order) {
            shared::StrandSegment s{vertex(p->a, p->radiusA, p->colourA), vertex(p->b, p->radiusB, p->colourB)};
            if (strands_.isRibbon[points_[p->a].strand] == 0) s.a.positionZ |= 0x80000000u;
            s.a.colour |= uint32_t{p->ownCode} << 24;
            s.b.colour |= uint32_t{p->octants} << 24;
            chunk.segments.push_back(s);
        }
        node.parts = {};
        return encodeStrandChunk(chunk);
    }

    const StrandSet& strands_;
    const StrandBuildSettings& settings_;
    Executor& executor_;
    std::vector<StrandPoint> points_;
    std::vector<StrandNode> nodes_;
    std::vector<double> kept_;  ///< share of the strands that a node draws, by length
    double finestCell_ = 1;
    uint32_t depth_ = 0;
};

}  // namespace

Result<BuildReport> buildStrandStore(const StrandSet& strands, const std::string& output,
                                     const StrandBuildSettings& settings, Executor& executor, Progress& progress) {
    BuildReport report;
    StageClock clock(report);
    report.primitive = "segment";
    report.dropped = strands.dropped;
    report.notes = strands.notes;
    if (strands.strands() == 0)
        return fail(ErrorKind::input, "holds no strand that can be drawn", settings.description.source);
    STIPPLE_ASSIGN(StoreWriter writer, StoreWriter::create(output));
    report.pointsIn = strands.position.size() - strands.strands();
    StrandBuilder builder(strands, settings, executor);
    builder.takeIn();
    builder.partition();
    clock.ends("partition");
    STIPPLE_TRY(builder.run(writer, progress));
    clock.ends("simplify");
    StoreDescription description = settings.description;
    description.isStrands = true;
    description.points = builder.leafParts;
    for (const Node& node : builder.h.nodes) description.records += node.records;
    description.roundingUnits = builder.rounding;
    description.boundsMin = description.focusMin = builder.boundsMin;
    description.boundsMax = description.focusMax = builder.boundsMax;
    description.hasColour = strands.hasColour;
    description.hasNormals = description.isReflectance = true;
    description.up = strands.up;
    STIPPLE_TRY(writer.finish(builder.h, description));
    clock.ends("finish");
    STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
    STIPPLE_TRY(verifyStore(store, executor));
    clock.ends("verify");
    report.pointsOut = builder.leafParts;
    report.bytesOut = writer.bytes();
    STIPPLE_TRY(writer.commit());
    report.nodes = builder.h.nodes.size();
    report.records = description.records;
    report.contentHash = writer.contentHash();
    if (builder.fewestKept < 1)
        report.notes.push_back(fmt::format(
            "from afar thin strands are drawn by lot: at the coarsest level 1 in {:.0f}, wider by as much; where the "
            "others were is left to chance and not part of the stated error",
            1 / builder.fewestKept));
    report.seconds = clock.seconds();
    return report;
}

}  // namespace stipple::lod
