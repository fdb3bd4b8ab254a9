// Curves as content of a build (octree/cell_build.h): each segment travels to the octree cell of its middle; cell by
// cell from the deepest up they are merged.
#include "lod/builder/curves/curve_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "engine/base/numbers.h"
#include "lod/builder/build_version.h"
#include "lod/builder/curves/curve_cell.h"
#include "lod/builder/octree/cell_build.h"
#include "lod/builder/points/outliers.h"
#include "lod/builder/points/spacing.h"
#include "lod/primitives/mesh_source.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kRootLog2 = 24, kMostRootLog2 = kPlaceBits - TravellingPoint::kStepBits;
constexpr uint32_t kDeepest = 20;                    ///< of 24
constexpr double kFar = 16;                          ///< times what most vertices span: that is far out
constexpr double kFineSteps = 64;                    ///< in what is visible of a segment, where curves lie far apart
constexpr size_t kFew = 64;                          ///< of fewer, one in fifty cannot be told from the others
constexpr double kMorePieces = 1 << 18;              ///< that all may be divided into where cells are too large
constexpr uint64_t kCellBytes = uint64_t{64} << 20;  ///< that one cell of the work needs at most
constexpr uint64_t kRunSegments = 64;                ///< of one subtree that are kept until they are sent

class CurveBuild : public CellContent {
  public:
    CurveBuild(const CurveSource& source, const CurveBuildSettings& settings) : source_(source), settings_(settings) {}

    const char* primitive() const override { return "segment"; }
    std::string source() const override { return settings_.description.source; }
    uint64_t declared() const override { return facts_.segments; }
    uint64_t inputIdentity() const override { return source_.identity(); }
    MemoryNeeds memory() const override {
        MemoryNeeds needs;
        needs.content = fmt::format("{} segments", source_.vertices);
        needs.fixed = uint64_t{96} << 20;
        needs.aWorker = kCellBytes;
        needs.tables = source_.vertices * kTableBytes;
        needs.between = source_.vertices * kSpillBytes;
        needs.whole = source_.vertices * 800;
        return needs;
    }
    std::string settingsAsText() const override {
        return fmt::format("{}|{}|{}", kBuildVersion, settings_.leafSegments, describeAsText(settings_.description));
    }

    // ---- survey, count, distribute ----

    Result<void> survey(const Workspace& workspace, Progress& progress, bool isKnown) override {
        if (isKnown) return {};
        STIPPLE_ASSIGN(Seen seen, look(workspace, progress));
        if (limitReach(seen)) {
            auto again = look(workspace, progress);
            if (!again) return tl::unexpected(again.error());
            seen = std::move(*again);
        }
        const auto& [octaves, details, notes, mended, bounds, given] = seen;
        notes_.assign(notes.begin(), notes.end());
        for (const auto& [what, count] : mended) notes_.push_back(fmt::format("{} {}", count, what));
        facts_.given = given > 0 ? given : facts_.segments;
        if (facts_.segments == 0) return fail(ErrorKind::input, "holds no curve that can be drawn", source());
        facts_.lo = bounds.lo;
        facts_.hi = bounds.hi;
        const glm::dvec3 size = facts_.hi - facts_.lo;
        const double extent = std::max({size.x, size.y, size.z, 1e-30});
        facts_.unit = std::exp2(std::floor(std::log2(extent)) + 1 - kRootLog2);
        facts_.rootLog2 = kRootLog2;
        // The finest, but for one segment in a hundred, is told apart however far curves lie from each other.
        const double detail = finestOf(details);
        refine(extent, bounds.sample, detail);
        const uint32_t deepest = std::min(facts_.rootLog2 - (kRootLog2 - kDeepest), kMortonBits);
        facts_.keyLevels = deepest;
        const auto piecesFor = [&](double cell) {
            double pieces = 0;
            for (const auto& [octave, count] : octaves)
                pieces +=
                    static_cast<double>(count) * CurveDivision::pieces(std::exp2(octave / 64.0) / facts_.unit, cell);
            return pieces;
        };
        const auto cellOf = [&](uint32_t level) { return std::exp2(double(facts_.rootLog2) - level); };
        const double most = 2.0 * static_cast<double>(facts_.segments);
        while (facts_.keyLevels > 0 && piecesFor(cellOf(facts_.keyLevels)) > most) --facts_.keyLevels;
        // (A few long ones among many short ones.)
        while (facts_.keyLevels < deepest &&
               facts_.fineness.isCoarse(curveStep(cellOf(facts_.keyLevels)), detail / facts_.unit) &&
               piecesFor(cellOf(facts_.keyLevels + 1)) <= most + kMorePieces)
            ++facts_.keyLevels;
        const Frame on = frame();
        std::vector<Key> vertices;
        for (const glm::dvec3& p : bounds.sample) {
            const glm::dvec3 at = glm::max(glm::floor(onLattice(p)), glm::dvec3(0));
            vertices.push_back(on.keyOf({toWhole<uint64_t>(at.x), toWhole<uint64_t>(at.y), toWhole<uint64_t>(at.z)}));
        }
        std::sort(vertices.begin(), vertices.end());
        vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
        division_ = CurveDivision(on, std::move(vertices));
        return {};
    }

    Frame frame() const override {
        Frame f;
        f.origin = facts_.lo;
        f.unit = facts_.unit;
        f.rootLog2 = facts_.rootLog2;
        f.keyLevels = facts_.keyLevels;
        f.errors = errorsOf(facts_.rootLog2);
        return f;
    }

    Result<void> places(const Places& take) override {
        std::vector<uint32_t> x, y, z;
        std::vector<uint64_t> high;
        std::vector<TravellingPoint> ends;
        facts_.parts = facts_.vertices = facts_.farOut = facts_.farFromAll = 0;
        return read([&](const CurveSet& block) -> Result<void> {
            for (const glm::dvec3& p : block.position) countFarOut(p);
            x.clear();
            y.clear();
            z.clear();
            high.clear();
            for (size_t s = 0; s < block.curves(); ++s) {
                const std::vector<TravellingPoint> points = pointsOf(block, s);
                for (size_t i = 1; i < points.size(); ++i) {
                    if (division_.divide(points[i - 1], points[i], ends)) facts_.farFromAll += ends.size() - 1;
                    const TravellingPoint* before = &points[i - 1];
                    for (const TravellingPoint& end : ends) {
                        const Place middle = TravellingPoint::middle(*before, end);
                        x.push_back(static_cast<uint32_t>(middle[0]));
                        y.push_back(static_cast<uint32_t>(middle[1]));
                        z.push_back(static_cast<uint32_t>(middle[2]));
                        if (facts_.rootLog2 > 32) high.push_back(highOf(middle));
                        before = &end;
                    }
                }
            }
            facts_.parts += x.size();
            return take({x, y, z, high}, facts_.segments);
        });
    }
    Result<void> check(const std::vector<Subtree>& subtrees) const override {
        for (const Subtree& subtree : subtrees)
            if (subtree.count > 4 * kSubtreePoints)
                return fail(ErrorKind::budget, fmt::format("{} segments lie within the length of one", subtree.count),
                            source(), "are the curves what they should be?");
        return {};
    }
    uint64_t temporaryBytes(int) const override { return facts_.segments * kSpillBytes; }

    /// Each segment to the subtrees that hold the middles of its pieces; those of a curve that stay together travel as
    /// one run.
    Result<void> send(CellSender& to) override {
        const Frame on = frame();
        std::vector<CurveRuns> buffers(to.subtrees().size());
        const uint64_t most = std::max<uint64_t>(
            to.bufferBytes() / std::max<size_t>(buffers.size(), 1) / sizeof(TravellingPoint), kRunSegments);
        const auto flush = [&](size_t a) {
            ByteWriter bytes;
            buffers[a].put(bytes);
            const uint64_t points = buffers[a].points.size();
            buffers[a] = {};
            return to.append(a, bytes.bytes(), points);
        };
        const auto flushAll = [&]() -> Result<void> {
            for (size_t a = 0; a < buffers.size(); ++a)
                if (!buffers[a].points.empty()) STIPPLE_TRY(flush(a));
            return {};
        };
        uint32_t curve = 0;
        std::vector<TravellingPoint> ends;
        std::vector<uint32_t> subtrees;
        // Curve and vertex of a run's end.
        std::vector<std::pair<uint32_t, uint32_t>> nextOf(buffers.size(), {~0u, 0});
        const Result<void> read = this->read([&](const CurveSet& block) -> Result<void> {
            uint64_t segments = 0;
            for (size_t s = 0; s < block.curves(); ++s) segments += block.first[s + 1] - block.first[s] - 1;
            if (to.begins()) {
                curve += static_cast<uint32_t>(block.curves());
                return to.ends(segments, facts_.segments, flushAll);
            }
            for (size_t s = 0; s < block.curves(); ++s, ++curve) {
                const std::vector<TravellingPoint> points = pointsOf(block, s);
                uint32_t number = 0;
                for (size_t i = 1; i < points.size(); ++i) {
                    division_.divide(points[i - 1], points[i], ends);
                    subtrees.clear();
                    const TravellingPoint* before = &points[i - 1];
                    for (const TravellingPoint& end : ends) {
                        const uint32_t subtree = to.subtreeOf(on.keyOf(TravellingPoint::middle(*before, end)));
                        if (to.isOwn(subtree) && std::find(subtrees.begin(), subtrees.end(), subtree) == subtrees.end())
                            subtrees.push_back(subtree);
                        before = &end;
                    }
                    for (const uint32_t subtree : subtrees) {
                        CurveRuns& runs = buffers[subtree];
                        if (runs.runs.empty() || nextOf[subtree] != std::pair(curve, static_cast<uint32_t>(i - 1))) {
                            runs.runs.push_back({curve, number, 1, block.isRibbon[s] != 0 ? 1u : 0u});
                            runs.points.push_back(points[i - 1]);
                        }
                        nextOf[subtree] = {curve, static_cast<uint32_t>(i)};
                        runs.points.push_back(points[i]);
                        ++runs.runs.back().points;
                        if (runs.points.size() >= most) STIPPLE_TRY(flush(subtree));
                    }
                    number += static_cast<uint32_t>(ends.size());
                }
            }
            return to.ends(segments, facts_.segments, flushAll);
        });
        return read ? flushAll() : read;
    }
    /// (Runs take no more room than they must.)
    Result<std::vector<uint8_t>> gathered(const std::vector<uint8_t>& input, const Subtree&, uint64_t&) const override {
        return input;
    }
    Result<void> complete(const CellInputs&) override { return {}; }

    void save(ByteWriter& to) const override {
        to.put(facts_);
        to.put(division_.vertices());
        to.put(notes_);
        for (const auto* counts : {&dropped_, &added_}) {
            to.put(uint64_t{counts->size()});
            for (const auto& [what, count] : *counts) {
                to.put(what);
                to.put(count);
            }
        }
    }
    void load(ByteReader& from) override {
        from.get(facts_);
        std::vector<Key> vertices;
        from.get(vertices);
        division_ = CurveDivision(frame(), std::move(vertices));
        from.get(notes_);
        for (auto* counts : {&dropped_, &added_}) {
            uint64_t reasons = 0;
            from.get(reasons);
            for (uint64_t k = 0; k < reasons && !from.isBroken(); ++k) {
                std::string what;
                from.get(what);
                from.get((*counts)[what]);
            }
        }
    }

    // ---- the work ----

    Result<CellProduct> make(const WorkCell& cell, const std::vector<uint8_t>& input,
                             const std::vector<FromBelow>& below) const override {
        return buildCurveCell(cell, input, below, frame(), settings_.leafSegments, facts_.fineness, division_);
    }

    uint64_t take(uint64_t at, const std::vector<uint8_t>& bytes) override {
        CurveTable table;
        ByteReader from(bytes);
        STIPPLE_CHECK(table.get(from), "the table of a cell");
        for (NodeBatch::Written& w : table.batch.nodes) w.node.chunkOffset += at;
        batches_.push_back(std::move(table.batch));
        rounding_ = std::max(rounding_, table.rounding);
        fewestKept_ = table.fewestKept;  // the root comes last
        return batches_.size();
    }

    // ---- the end ----

    Result<Hierarchy> describe(StoreWriter&, StoreDescription& description, BuildReport& report) override {
        Hierarchy hierarchy = assemble(frame(), batches_);
        batches_ = {};
        hierarchy.isCurves = true;
        for (Node& node : hierarchy.nodes) setKind(node, Kind::curves);
        description = settings_.description;
        description.isCurves = true;
        description.points = facts_.parts;
        description.roundingUnits = rounding_ * facts_.unit;
        description.boundsMin = facts_.lo;
        description.boundsMax = facts_.hi;
        description.focusMin = facts_.focusLow;
        description.focusMax = facts_.focusHigh;
        description.hasColour = facts_.hasColour;
        description.hasNormals = description.isReflectance = true;
        description.up = facts_.up;
        const uint64_t even = facts_.parts - facts_.segments - facts_.farFromAll;
        if (even > 0) added_["by dividing long ones"] = even;
        if (facts_.farFromAll > 0)
            added_["by dividing very long ones (between vertices within a 16,384th of the way to the nearest one)"] =
                facts_.farFromAll;
        report.pointsIn = description.pointsIn = facts_.given;
        report.pointsOut = facts_.parts;
        report.notes = notes_;
        if (facts_.farOut > 0)
            report.notes.insert(report.notes.begin(),
                                fmt::format("OUTLIERS: {} of {} vertices lie far outside of all others (up to {:.7g} "
                                            "units away): the default view leaves them out",
                                            facts_.farOut, facts_.vertices, facts_.farthest));
        report.dropped = description.dropped = dropped_;
        report.added = description.added = added_;
        if (fewestKept_ < 1)
            report.coarseNotes.push_back(fmt::format(
                "from afar thin curves are pruned: at the coarsest level 1 in {:.0f}, wider by as much; where "
                "the others were is stochastic and not part of the stated error",
                1 / fewestKept_));
        return hierarchy;
    }

  private:
    static constexpr uint64_t kSpillBytes = 16;  ///< of a segment, between the steps
    static constexpr uint64_t kTableBytes = 5;   ///< of a segment, of the node table, which stays in memory

    /// What is known after reading everything once, and what a resumed build has to know.
    struct Facts {
        glm::dvec3 lo{1e300}, hi{-1e300}, focusLow{0}, focusHigh{0}, up{0, 0, 1};
        double unit = 1;
        Fineness fineness;
        uint64_t given = 0, segments = 0, parts = 0;  ///< of the input, of clean curves, and divided
        uint64_t vertices = 0, farOut = 0;            ///< of them, far outside of all others
        double farthest = 0;                          ///< of those from the others' box, file units
        glm::dvec3 reachLow{-std::numeric_limits<double>::infinity()}, reachHigh{-reachLow};  ///< see limitReach
        uint64_t farFromAll = 0;  ///< added to segments that are divided unevenly
        uint32_t rootLog2 = kRootLog2, keyLevels = 0;
        bool hasColour = false;
    };
    /// What a pass over the input shows. Segments longer than a cell are divided. The shortest cell for which that does
    /// not more than double their number: lengths are counted once, for all sizes of cells.
    struct Seen {
        std::map<int, uint64_t> octaves;  ///< of lengths, rounded up to 1/64 octave: few enough to keep
        std::map<int, uint64_t> details;  ///< likewise of what is visible of a segment, rounded down
        std::set<std::string> notes;
        std::map<std::string, uint64_t> mended;
        MeshSource::Bounds bounds;
        uint64_t given = 0;
    };
    Result<Seen> look(const Workspace& workspace, Progress& progress) {
        Seen seen;
        facts_.segments = 0;
        dropped_.clear();
        added_.clear();
        STIPPLE_TRY(read([&](const CurveSet& block) -> Result<void> {
            facts_.hasColour = facts_.hasColour || block.hasColour;
            facts_.up = block.up;
            for (const auto& [what, count] : block.dropped) dropped_[what] += count;
            for (const auto& [what, count] : block.mended) seen.mended[what] += count;
            seen.given += block.segmentsIn;
            if (block.segmentsAdded > 0) added_["where ribbons twist"] += block.segmentsAdded;
            seen.notes.insert(block.notes.begin(), block.notes.end());
            for (size_t s = 0; s < block.curves(); ++s)
                for (uint32_t i = block.first[s]; i < block.first[s + 1]; ++i) {
                    seen.bounds.add(block.position[i]);
                    if (i == block.first[s]) continue;
                    ++facts_.segments;
                    const double length = glm::length(block.position[i] - block.position[i - 1]);
                    ++seen.octaves[toWhole<int>(std::ceil(std::log2(std::max(length, 1e-300)) * 64))];
                    const double detail = detailOf(double{block.radius[i]}, length);
                    ++seen.details[toWhole<int>(std::floor(std::log2(std::max(detail, 1e-300)) * 64))];
                }
            progress.update("survey", std::min(facts_.segments, source_.vertices), source_.vertices);
            return workspace.checkStopped();
        }));
        return seen;
    }
    /// The finest, but for one segment in a hundred.
    double finestOf(const std::map<int, uint64_t>& details) const {
        uint64_t below = 0;
        double detail = 0;
        for (const auto& [octave, count] : details) {
            detail = std::exp2(octave / 64.0);
            if ((below += count) * 100 >= facts_.segments) break;
        }
        return detail;
    }
    /// True: vertices lie so far out that beside them nothing would be left of the others. They are left out from here
    /// on, and what lies as far that others have fewer than kFineSteps.
    bool limitReach(const Seen& seen) {
        const glm::dvec3 lo = seen.bounds.lo, hi = seen.bounds.hi;
        std::vector<glm::dvec3> sample = seen.bounds.sample;
        std::erase_if(sample, [](const glm::dvec3& p) { return !isPlace(p); });
        const double detail = finestOf(seen.details), most = detail * std::exp2(double{kMostRootLog2});
        if (sample.size() < kFew || !(detail > 0) ||
            (isPlace(lo) && isPlace(hi) && !(std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z}) > most)))
            return false;
        const glm::dvec3 middle = denseBox(sample).middle, reach(most / (4 * kFineSteps));
        facts_.reachLow = middle - reach;
        facts_.reachHigh = middle + reach;
        return true;
    }
    /// The input, without what is left out.
    Result<void> read(const CurveSource::Take& take) const {
        return source_.read([&](const CurveSet& block) {
            const auto isOut = [&](const glm::dvec3& p) { return !isInReach(p); };
            return std::any_of(block.position.begin(), block.position.end(), isOut) ? take(inReach(block))
                                                                                    : take(block);
        });
    }
    bool isInReach(const glm::dvec3& p) const {
        return glm::all(glm::lessThanEqual(facts_.reachLow, p)) && glm::all(glm::lessThanEqual(p, facts_.reachHigh));
    }
    /// Curves end before a vertex that is left out, and go on behind it.
    CurveSet inReach(const CurveSet& block) const {
        CurveSet out;
        out.hasColour = block.hasColour;
        out.up = block.up;
        out.dropped = block.dropped;
        out.mended = block.mended;
        out.segmentsIn = block.segmentsIn;
        out.segmentsAdded = block.segmentsAdded;
        out.notes = block.notes;
        for (size_t s = 0; s < block.curves(); ++s) {
            const uint32_t begin = block.first[s], end = block.first[s + 1];
            for (uint32_t i = begin; i < end;) {
                uint32_t last = i;
                while (last < end && isInReach(block.position[last])) ++last;
                if (last - i >= 2) {
                    for (uint32_t v = i; v < last; ++v)
                        out.addVertex(block.position[v], block.radius[v], block.normal[v], block.colour[v]);
                    out.endCurve(block.isRibbon[s] != 0);
                }
                i = std::max(last, i + 1);
            }
        }
        const auto segments = [](const CurveSet& set) { return set.position.size() - set.curves(); };
        const uint64_t left = segments(block) - segments(out);
        out.dropped["that reach too far out for the others' places"] += left;
        return out;
    }
    /// (The box is that of a sample: what lies within its own size of it may belong to it.)
    void countFarOut(const glm::dvec3& p) {
        ++facts_.vertices;
        const glm::dvec3 size = facts_.focusHigh - facts_.focusLow;
        const glm::dvec3 off = glm::max(glm::max(facts_.focusLow - p, p - facts_.focusHigh), glm::dvec3(0));
        const double reach = std::max({size.x, size.y, size.z}), distance = std::max({off.x, off.y, off.z});
        if (!(distance > reach)) return;
        ++facts_.farOut;
        facts_.farthest = std::max(facts_.farthest, distance);
    }
    /// What most curves are is told apart however far from them, or from each other, curves lie.
    void refine(double extent, const std::vector<glm::dvec3>& sample, double detail) {
        const double dense = denseExtent(sample);
        const bool isFarOut = dense > 0 && extent > kFar * dense && sample.size() >= kFew;
        if (isFarOut) {
            const DenseBox box = denseBox(sample);
            facts_.focusLow = box.lo;
            facts_.focusHigh = box.hi;
        } else {
            facts_.focusLow = facts_.lo;
            facts_.focusHigh = facts_.hi;
        }
        const double wanted = isFarOut ? std::min(detail, dense * std::exp2(-double{kDeepest})) : detail;
        const bool isFar = isFarOut || 4 * facts_.unit > detail;
        if (!isFar) return;
        for (; facts_.rootLog2 < kMostRootLog2 && kFineSteps * facts_.unit > wanted; ++facts_.rootLog2)
            facts_.unit *= 0.5;
        facts_.fineness.stepsInDetail = kFineSteps;
        // (The root of what is not far out, alone, has 2^15 steps.)
        if (isFarOut) facts_.fineness.mostStep = std::max(dense * 0x1p-14 / facts_.unit, 0x1p-6);
        // Whole steps from zero, so that sums with it are as exact as doubles are.
        const glm::dvec3 whole = glm::floor(facts_.lo / facts_.unit) * facts_.unit, size = facts_.hi - whole;
        if (std::max({size.x, size.y, size.z}) < facts_.unit * (std::exp2(facts_.rootLog2) - 1)) facts_.lo = whole;
    }
    glm::dvec3 onLattice(const glm::dvec3& p) const { return (p - facts_.lo) / facts_.unit; }

    CurvePoint pointOf(const CurveSet& set, size_t s, uint32_t i) const {
        const uint32_t a = std::max(i, set.first[s] + 1) - 1, b = std::min(i + 1, set.first[s + 1] - 1);
        const glm::dvec3 chord = set.position[b] - set.position[a];
        const glm::dvec3 own = set.position[std::max(i, a + 1)] - set.position[a];
        glm::vec3 d(glm::normalize(glm::length(chord) > 1e-6 * glm::length(own) ? chord : own));
        if (set.isRibbon[s] != 0) {
            const glm::vec3 across = glm::cross(set.normal[i], d);
            d = glm::length(across) > 1e-3f
                    ? glm::normalize(across)
                    : glm::normalize(std::abs(d.x) < 0.7f ? glm::vec3(0, -d.z, d.y) : glm::vec3(-d.z, 0, d.x));
        }
        CurvePoint p;
        p.p = onLattice(set.position[i]);
        p.radius = set.radius[i] / static_cast<float>(facts_.unit);
        p.direction = d;
        p.colour = set.colour[i] & 0xffffffu;
        return p;
    }

    /// The points of one curve as they travel.
    std::vector<TravellingPoint> pointsOf(const CurveSet& set, size_t s) const {
        std::vector<TravellingPoint> out;
        for (uint32_t i = set.first[s]; i < set.first[s + 1]; ++i) out.emplace_back(pointOf(set, s, i));
        return out;
    }
    const CurveSource& source_;
    const CurveBuildSettings& settings_;
    Facts facts_;
    CurveDivision division_;
    std::vector<std::string> notes_;
    std::map<std::string, uint64_t> dropped_, added_;
    std::vector<NodeBatch> batches_;
    double rounding_ = 0, fewestKept_ = 1;
};

}  // namespace

Result<BuildReport> buildCurveStore(const CurveSource& source, const std::string& output,
                                    const CurveBuildSettings& settings, Executor& executor, Progress& progress) {
    CurveBuild content(source, settings);
    return buildCells(content, output, settings.limits, executor, progress);
}

}  // namespace stipple::lod
