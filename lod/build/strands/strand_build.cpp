// A build of strands as a straight line: survey, count, distribute to octree cells, then cell by cell from the deepest
// up merge and write; verify.
#include "lod/build/strands/strand_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "lod/build/strands/strand_cell.h"

namespace stipple::lod {
namespace {

constexpr uint32_t kRootLog2 = 24;
constexpr uint32_t kDeepest = 20;
constexpr uint64_t kVerifiedNodes = 2048;            ///< at the end of a build; `info --verify` checks all
constexpr uint64_t kBuildVersion = 1;                ///< of what the same input gives
constexpr uint64_t kCellBytes = uint64_t{64} << 20;  ///< that one cell of the work needs at most
constexpr uint64_t kRunSegments = 64;                ///< of one atom that are kept until they are sent

class StrandBuild {
  public:
    StrandBuild(const StrandSource& source, std::string output, const StrandBuildSettings& settings, Executor& executor,
                Progress& progress)
        : source_(source),
          output_(std::move(output)),
          settings_(settings),
          executor_(executor),
          progress_(progress),
          clock_(report_),
          workers_(std::max(executor.threads(), 1)) {}

    Result<BuildReport> run() {
        report_.primitive = "segment";
        { STIPPLE_ASSIGN(const StoreWriter writer, StoreWriter::create(output_)); }  // can it be written at all?
        STIPPLE_TRY(planMemory());
        const uint64_t identity = source_.identity();
        STIPPLE_ASSIGN(Reduction work, Reduction::open(output_, settings_.limits, identityOf(identity), isOnDisk_));
        work_.emplace(std::move(work));
        report_.isResumed = work_->isResumed();
        if (report_.isResumed) {
            STIPPLE_TRY(restore());
        } else {
            STIPPLE_TRY(survey());
            STIPPLE_TRY(distribute());
            if (source_.identity() != identity)
                return fail(ErrorKind::input, "changed while it was read", settings_.description.source,
                            "build again when it is complete");
            STIPPLE_TRY(work_->seal(factsAsBytes(), executor_));
            clock_.ends("distribute");
        }
        const Frame frame = frameOf();
        STIPPLE_TRY(work_->run(
            executor_, workers_,
            [&](const WorkCell& cell, const std::vector<uint8_t>& input, const std::vector<FromBelow>& below) {
                return buildStrandCell(cell, input, below, frame, settings_.leafSegments);
            },
            [&](uint64_t at, const std::vector<uint8_t>& table) { return take(at, table); }, progress_));
        clock_.ends("build");
        STIPPLE_TRY(finish(frame));
        report_.seconds = clock_.seconds();
        return std::move(report_);
    }

  private:
    static constexpr uint64_t kSpillBytes = 16;  ///< of a segment, between the steps
    static constexpr uint64_t kTableBytes = 5;   ///< of a segment, of the node table, which stays in memory

    Result<void> planMemory() {
        constexpr uint64_t kFixed = uint64_t{96} << 20;
        const auto leastFor = [&](int workers) {
            return kFixed + static_cast<uint64_t>(workers) * kCellBytes + source_.vertices * kTableBytes;
        };
        const uint64_t memory = settings_.limits.memoryBytes, small = kFixed + source_.vertices * 800;
        while (workers_ > 1 && leastFor(workers_) > memory) --workers_;
        const uint64_t least = std::min(leastFor(workers_), small);
        if (least > memory)
            return fail(ErrorKind::budget,
                        fmt::format("building {} segments needs {} MiB, but --memory allows {} MiB", source_.vertices,
                                    (least >> 20) + 1, memory >> 20),
                        settings_.description.source, fmt::format("give --memory {}M", (least >> 20) + 1));
        const uint64_t room = memory > leastFor(workers_) ? memory - leastFor(workers_) : 0;
        isOnDisk_ = small > memory && source_.vertices * kSpillBytes > room / 2;
        bufferBytes_ = std::clamp<uint64_t>(room / 4, uint64_t{4} << 20, uint64_t{64} << 20);
        return {};
    }
    uint64_t identityOf(uint64_t input) const {
        const std::string text = fmt::format("{}|{}|{}|{}|{}", kStoreVersion, kBuildVersion, input,
                                             settings_.leafSegments, describeAsText(settings_.description));
        return hashBytes(text.data(), text.size());
    }

    // ---- survey, count, distribute ----

    /// What is known after reading everything once, and what a resumed build has to know.
    struct Facts {
        glm::dvec3 lo{1e300}, hi{-1e300}, up{0, 0, 1};
        double unit = 1;
        uint64_t segments = 0, parts = 0;
        uint32_t keyLevels = 0;
        bool hasColour = false;
    };
    glm::dvec3 onLattice(const glm::dvec3& p) const { return (p - facts_.lo) / facts_.unit; }

    Result<void> survey() {
        // Segments longer than a cell are divided. The shortest cell for which that does not more than double their
        // number: lengths are counted once, for all sizes of cells.
        std::map<int, uint64_t> octaves;  // of lengths, rounded up to 1/64 octave: few enough to keep
        std::set<std::string> notes;
        STIPPLE_TRY(source_.read([&](const StrandSet& block) -> Result<void> {
            facts_.hasColour = facts_.hasColour || block.hasColour;
            facts_.up = block.up;
            for (const auto& [what, count] : block.dropped) report_.dropped[what] += count;
            notes.insert(block.notes.begin(), block.notes.end());
            for (size_t s = 0; s < block.strands(); ++s)
                for (uint32_t i = block.first[s]; i < block.first[s + 1]; ++i) {
                    facts_.lo = glm::min(facts_.lo, block.position[i]);
                    facts_.hi = glm::max(facts_.hi, block.position[i]);
                    if (i == block.first[s]) continue;
                    ++facts_.segments;
                    const double length = glm::length(block.position[i] - block.position[i - 1]);
                    ++octaves[static_cast<int>(std::ceil(std::log2(std::max(length, 1e-300)) * 64))];
                }
            progress_.update("survey", std::min(facts_.segments, source_.vertices), source_.vertices);
            return work_->checkStopped();
        }));
        report_.notes.assign(notes.begin(), notes.end());
        if (facts_.segments == 0)
            return fail(ErrorKind::input, "holds no strand that can be drawn", settings_.description.source);
        const glm::dvec3 size = facts_.hi - facts_.lo;
        const double extent = std::max({size.x, size.y, size.z, 1e-30});
        facts_.unit = std::exp2(std::floor(std::log2(extent)) + 1 - kRootLog2);
        facts_.keyLevels = kDeepest;
        const auto piecesFor = [&](double longest) {
            double pieces = 0;
            for (const auto& [octave, count] : octaves)
                pieces += static_cast<double>(count) *
                          std::max(1.0, std::ceil(std::exp2(octave / 64.0) / facts_.unit / longest));
            return pieces;
        };
        while (facts_.keyLevels > 0 &&
               piecesFor(std::exp2(double{kRootLog2} - facts_.keyLevels)) > 2.0 * static_cast<double>(facts_.segments))
            --facts_.keyLevels;
        clock_.ends("survey");
        return {};
    }

    Frame frameOf() const {
        Frame f;
        f.origin = facts_.lo;
        f.unit = facts_.unit;
        f.rootLog2 = kRootLog2;
        f.keyLevels = facts_.keyLevels;
        f.errors = errorsOf(kRootLog2);
        return f;
    }

    StrandPoint pointOf(const StrandSet& set, size_t s, uint32_t i) const {
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
        StrandPoint p;
        p.p = onLattice(set.position[i]);
        p.radius = set.radius[i] / static_cast<float>(facts_.unit);
        p.direction = d;
        p.colour = set.colour[i] & 0xffffffu;
        return p;
    }

    /// The points of one strand as they travel.
    std::vector<TravellingPoint> pointsOf(const StrandSet& set, size_t s) const {
        std::vector<TravellingPoint> out;
        for (uint32_t i = set.first[s]; i < set.first[s + 1]; ++i) out.emplace_back(pointOf(set, s, i));
        return out;
    }
    double longest() const { return std::exp2(double{kRootLog2} - facts_.keyLevels); }

    Result<void> distribute() {
        const Frame frame = frameOf();
        CellTree tree(frame, facts_.segments);
        std::vector<uint32_t> x, y, z;
        std::vector<TravellingPoint> ends;
        do {
            facts_.parts = 0;
            uint64_t done = 0;
            STIPPLE_TRY(source_.read([&](const StrandSet& block) -> Result<void> {
                x.clear();
                y.clear();
                z.clear();
                for (size_t s = 0; s < block.strands(); ++s) {
                    const std::vector<TravellingPoint> points = pointsOf(block, s);
                    for (size_t i = 1; i < points.size(); ++i) {
                        divide(points[i - 1], points[i], longest(), ends);
                        const TravellingPoint* before = &points[i - 1];
                        for (const TravellingPoint& end : ends) {
                            x.push_back(TravellingPoint::middle(before->x, end.x));
                            y.push_back(TravellingPoint::middle(before->y, end.y));
                            z.push_back(TravellingPoint::middle(before->z, end.z));
                            before = &end;
                        }
                    }
                }
                tree.count({x, y, z});
                facts_.parts += x.size();
                progress_.update("count", std::min(done += x.size(), facts_.segments), facts_.segments);
                return work_->checkStopped();
            }));
        } while (tree.split());
        tree.finish();
        clock_.ends("count");
        std::vector<Atom> atoms = tree.atoms();
        for (const Atom& atom : atoms)
            if (atom.count > 4 * kAtomPoints)
                return fail(ErrorKind::budget, fmt::format("{} segments lie within the length of one", atom.count),
                            settings_.description.source, "are the strands what they should be?");
        if (const Journal* const journal = work_->journal())
            STIPPLE_TRY(journal->announce(facts_.segments * kSpillBytes, progress_));
        std::vector<uint32_t> atomOfCell(tree.cells().size());
        for (uint32_t a = 0; a < atoms.size(); ++a)
            for (uint32_t c = 0; c < atoms[a].cells; ++c) atomOfCell[atoms[a].firstCell + c] = a;
        std::vector<StrandRuns> buffers(atoms.size());
        work_->plan(std::move(atoms));
        return send(frame, tree, atomOfCell, buffers);
    }

    /// Each segment to the atoms that hold the middles of its pieces; those of a strand that stay together travel as
    /// one run.
    Result<void> send(const Frame& frame, const CellTree& tree, const std::vector<uint32_t>& atomOfCell,
                      std::vector<StrandRuns>& buffers) {
        const uint64_t most = std::max<uint64_t>(
            bufferBytes_ / std::max<size_t>(buffers.size(), 1) / sizeof(TravellingPoint), kRunSegments);
        const auto flush = [&](size_t a) {
            ByteWriter to;
            buffers[a].put(to);
            buffers[a] = {};
            return work_->input(a).append(to.bytes());
        };
        uint64_t done = 0;
        uint32_t strand = 0;
        std::vector<TravellingPoint> ends;
        std::vector<uint32_t> to;
        std::vector<std::pair<uint32_t, uint32_t>> nextOf(buffers.size(),
                                                          {~0u, 0});  // strand and vertex of a run's end
        const Result<void> read = source_.read([&](const StrandSet& block) -> Result<void> {
            for (size_t s = 0; s < block.strands(); ++s, ++strand) {
                const std::vector<TravellingPoint> points = pointsOf(block, s);
                uint32_t number = 0;
                for (size_t i = 1; i < points.size(); ++i) {
                    divide(points[i - 1], points[i], longest(), ends);
                    to.clear();
                    const TravellingPoint* before = &points[i - 1];
                    for (const TravellingPoint& end : ends) {
                        const uint32_t atom = atomOfCell[tree.cellOf(frame.keyOf(
                            TravellingPoint::middle(before->x, end.x), TravellingPoint::middle(before->y, end.y),
                            TravellingPoint::middle(before->z, end.z)))];
                        if (std::find(to.begin(), to.end(), atom) == to.end()) to.push_back(atom);
                        before = &end;
                    }
                    for (const uint32_t atom : to) {
                        StrandRuns& runs = buffers[atom];
                        if (runs.runs.empty() || nextOf[atom] != std::pair(strand, static_cast<uint32_t>(i - 1))) {
                            runs.runs.push_back({strand, number, 1, block.isRibbon[s] != 0 ? 1u : 0u});
                            runs.points.push_back(points[i - 1]);
                        }
                        nextOf[atom] = {strand, static_cast<uint32_t>(i)};
                        runs.points.push_back(points[i]);
                        ++runs.runs.back().points;
                        if (runs.points.size() >= most) STIPPLE_TRY(flush(atom));
                    }
                    number += static_cast<uint32_t>(ends.size());
                    done += ends.size();
                }
            }
            progress_.update("distribute", std::min(done, facts_.parts), facts_.parts);
            return work_->checkStopped();
        });
        if (!read) return read;
        for (size_t a = 0; a < buffers.size(); ++a)
            if (!buffers[a].points.empty()) STIPPLE_TRY(flush(a));
        return {};
    }

    std::vector<uint8_t> factsAsBytes() const {
        ByteWriter to;
        to.put(facts_);
        to.put(report_.notes);
        to.put(uint64_t{report_.dropped.size()});
        for (const auto& [what, count] : report_.dropped) {
            to.put(what);
            to.put(count);
        }
        return to.bytes();
    }
    Result<void> restore() {
        ByteReader from(work_->facts());
        uint64_t reasons = 0;
        from.get(facts_);
        from.get(report_.notes);
        from.get(reasons);
        for (uint64_t k = 0; k < reasons && k < 100; ++k) {
            std::string what;
            uint64_t count = 0;
            from.get(what);
            from.get(count);
            report_.dropped[what] = count;
        }
        if (!from.isWhole())
            return fail(ErrorKind::input, "holds a damaged journal", work_->journal()->folder(), "delete the folder");
        return work_->restore(progress_);
    }

    // ---- the end ----

    uint64_t take(uint64_t at, const std::vector<uint8_t>& bytes) {
        StrandTable table;
        ByteReader from(bytes);
        STIPPLE_CHECK(table.get(from), "the table of a cell");
        for (NodeBatch::Written& w : table.batch.nodes) w.node.chunkOffset += at;
        batches_.push_back(std::move(table.batch));
        rounding_ = std::max(rounding_, table.rounding);
        fewestKept_ = table.fewestKept;  // the root comes last
        return batches_.size();
    }

    Result<void> finish(const Frame& frame) {
        Hierarchy hierarchy = assemble(frame, batches_);
        batches_ = {};
        hierarchy.isStrands = true;
        StoreDescription description = settings_.description;
        description.isStrands = true;
        description.points = facts_.parts;
        for (const Node& node : hierarchy.nodes) description.records += node.records;
        description.roundingUnits = rounding_ * facts_.unit;
        description.boundsMin = description.focusMin = facts_.lo;
        description.boundsMax = description.focusMax = facts_.hi;
        description.hasColour = facts_.hasColour;
        description.hasNormals = description.isReflectance = true;
        description.up = facts_.up;
        StoreWriter& writer = work_->writer();
        STIPPLE_TRY(writer.finish(hierarchy, description));
        clock_.ends("finish");
        report_.nodes = hierarchy.nodes.size();
        hierarchy = {};  // its memory is needed
        STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
        STIPPLE_TRY(verifyStore(store, executor_, report_.nodes > kVerifiedNodes ? kVerifiedNodes : 0));
        clock_.ends("verify");
        report_.pointsIn = facts_.segments;
        report_.pointsOut = facts_.parts;
        report_.bytesOut = writer.bytes();
        STIPPLE_TRY(writer.commit());
        work_->finish();
        report_.temporaryBytes = work_->temporaryBytes();
        report_.records = description.records;
        report_.contentHash = writer.contentHash();
        if (fewestKept_ < 1)
            report_.notes.push_back(fmt::format(
                "from afar thin strands are drawn by lot: at the coarsest level 1 in {:.0f}, wider by as much; where "
                "the others were is left to chance and not part of the stated error",
                1 / fewestKept_));
        return {};
    }

    const StrandSource& source_;
    const std::string output_;
    const StrandBuildSettings& settings_;
    Executor& executor_;
    Progress& progress_;
    BuildReport report_;
    StageClock clock_;
    int workers_;
    bool isOnDisk_ = false;
    uint64_t bufferBytes_ = 0;
    std::optional<Reduction> work_;
    Facts facts_;
    std::vector<NodeBatch> batches_;
    double rounding_ = 0, fewestKept_ = 1;
};

}  // namespace

Result<BuildReport> buildStrandStore(const StrandSource& source, const std::string& output,
                                     const StrandBuildSettings& settings, Executor& executor, Progress& progress) {
    return StrandBuild(source, output, settings, executor, progress).run();
}

}  // namespace stipple::lod
