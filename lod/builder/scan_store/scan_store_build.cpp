// Points as content of a build (octree/cell_build.h) whose nodes hold patches: each travels to the octree cell that it
// lies in, and to those near it; cell by cell from the deepest up, patches are made of them.
#include "lod/builder/scan_store/scan_store_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "engine/base/check.h"
#include "engine/base/words.h"
#include "lod/builder/build_version.h"
#include "lod/builder/octree/cell_build.h"
#include "lod/builder/patch_store/subtree_margins.h"
#include "lod/builder/points/describe_input.h"
#include "lod/builder/scan_store/height_counts.h"
#include "lod/builder/scan_store/scan_cell.h"
#include "lod/builder/scan_store/scan_points.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kCellBytes = uint64_t{128} << 20;  ///< that one cell of the work needs at most
constexpr uint32_t kFewestOfLeaf = 64;                ///< points, however many samples are wanted
constexpr double kCoarsest = 1.0 / 16;                ///< steps of the build, in the spacing of dense points
constexpr uint32_t kRecordsABlock = 100;              ///< samples of a block of patches, about
constexpr uint64_t kAtOnce = uint64_t{1} << 20;       ///< points between two steps of the distribution

class ScanBuild : public CellContent {
  public:
    ScanBuild(PointInput input, BuildReport found, const ScanBuildSettings& settings, Executor& executor)
        : input_(std::move(input)), found_(std::move(found)), settings_(settings), executor_(executor) {
        cell_.coneDegrees = settings.coneDegrees;
        cell_.leafPoints = settings.leafPoints;
        cell_.isStopped = settings.points.isStopped;
        workers_ = std::max(executor.threads(), 1);
        if (settings.samples == 0) return;
        const double times =
            std::max(static_cast<double>(input_.declared()), 1.0) / static_cast<double>(settings.samples);
        cell_.isAsked = true;
        cell_.samplesAPoint /= times;
        cell_.leafPoints =
            static_cast<uint32_t>(std::clamp(times * cell_.leafPoints, double{kFewestOfLeaf}, double{kSubtreePoints}));
    }

    const char* primitive() const override { return "point"; }
    std::string source() const override { return input_.source; }
    uint64_t declared() const override { return input_.declared(); }
    uint64_t inputIdentity() const override { return input_.identity(); }
    MemoryNeeds memory() const override {
        const uint64_t n = input_.declared();
        MemoryNeeds needs;
        needs.content = fmt::format("patches of {} points", n);
        needs.fixed = (uint64_t{96} << 20) + static_cast<uint64_t>(workers_) * kReaderBytes + kAtOnce * kSpillBytes;
        needs.aWorker = kCellBytes;
        needs.tables = n * kTableBytes;
        needs.between = n * kSpillBytes;
        needs.whole = n * 1000;
        return needs;
    }
    std::string settingsAsText() const override {
        const BuildSettings& p = settings_.points;
        return fmt::format("scan patches|{}|{}|{}|{}|{}|{}|{}|{}", kBuildVersion, settings_.coneDegrees,
                           settings_.samples, settings_.leafPoints, kScanCells, p.up ? static_cast<int>(*p.up) : -1,
                           p.skipBad, p.dropOutliers);
    }

    // ---- survey, count, distribute ----

    Result<void> survey(const Workspace& workspace, Progress& progress, bool isKnown) override {
        if (isKnown) return {};
        STIPPLE_TRY(input_.survey(found_, executor_, progress));
        STIPPLE_TRY(workspace.checkStopped());
        // Of steps that are so fine that 32 bits are too few, the last bits say nothing, or some points lie far out.
        const double coarse = std::exp2(coarser());
        if (coarser() > 0 && (!(input_.resolution > 0) || coarse > kCoarsest * input_.resolution))
            return fail(ErrorKind::input, "some of its points lie too far from all others for patches", source(),
                        "leave them out (--drop-outliers), or build it without --patches");
        input_.sample = {};
        far_ = input_.farCubes(workers_);
        return {};
    }
    Frame frame() const override {
        const auto& g = input_.greatest;
        const int k = coarser();
        return makeFrame(input_.origin, unit(), std::max({g[0], g[1], g[2]}) >> k, 0,
                         std::ldexp(input_.resolution, -k));
    }
    Result<void> places(const Places& take) override {
        Progress silent(false);
        HeightCounts heights(input_.origin, unit(), greatest(), describeInput(input_, settings_.points).up);
        STIPPLE_ASSIGN(rounding_, input_.read(
                                      executor_, workers_, silent, "count", {},
                                      [&](int, const Points& block) {
                                          for (size_t i = 0; i < block.size(); ++i) heights.add(placeAt(block, i));
                                          if (coarser() == 0) return take(block.coordinates(), input_.points);
                                          std::array<std::vector<uint32_t>, 3> at;
                                          for (size_t i = 0; i < block.size(); ++i)
                                              for (size_t a = 0; a < 3; ++a)
                                                  at.at(a).push_back(placeAt(block, i).at(a));
                                          return take({at[0], at[1], at[2]}, input_.points);
                                      },
                                      PointInput::Wanted::places, &far_));
        if (!far_.empty()) input_.concludeOutliers(std::exchange(far_, {}), found_);
        heights_ = {heights.below(0.02), heights.below(0.98)};
        ByteWriter to;
        input_.save(to);
        surveyed_ = to.bytes();
        return {};
    }
    Result<void> check(const std::vector<Subtree>& subtrees) const override {
        if (subtrees.empty()) return fail(ErrorKind::input, "holds no points", source());
        for (const Subtree& a : subtrees)
            if (a.count > 4 * kSubtreePoints)
                return fail(ErrorKind::budget, fmt::format("{} points lie nearly at one place", a.count), source(),
                            "build it without --patches");
        return {};
    }
    uint64_t temporaryBytes(int) const override { return input_.points * kSpillBytes; }

    /// Each point to the subtree that holds it, and to those that it lies near.
    Result<void> send(CellSender& to) override {
        cell_.hasNormals = input_.hasNormal;
        const Frame on = frame();
        const SubtreeMargins margins(on, to.subtrees(), kScanMargin);
        Progress silent(false);
        const auto flush = []() { return Result<void>(); };  // nothing waits
        PointInput::Range range{0, 0, 0};
        while (range.end < input_.parts()) {
            range = input_.nextRange(range, kAtOnce);
            const uint64_t after = input_.nextRange(range, 0).before;
            if (to.begins()) {
                STIPPLE_TRY(to.ends(after - range.before, input_.points, flush));
                continue;
            }
            std::vector<std::vector<Sent>> sent(static_cast<size_t>(workers_));
            STIPPLE_TRY(input_.read(executor_, workers_, silent, "distribute", range,
                                    [&](int worker, const Points& block) -> Result<void> {
                                        share(block, on, margins, to, sent[static_cast<size_t>(worker)]);
                                        return {};
                                    }));
            STIPPLE_TRY(appendAll(sent, to));
            STIPPLE_TRY(to.ends(after - range.before, input_.points, flush));
        }
        return {};
    }
    Result<std::vector<uint8_t>> gathered(const std::vector<uint8_t>& input, const Subtree&, uint64_t&) const override {
        return input;
    }
    Result<void> complete(const CellInputs& inputs) override {
        if (isBroken_)
            return fail(ErrorKind::input, "what an interrupted build left is damaged", source(),
                        "begin anew with --restart");
        subtrees_ = inputs.subtrees();
        // (Of coarser steps the corner of one stands for all of it.)
        cell_.rounding = rounding_ / unit() * std::sqrt(3.0) + (coarser() > 0 ? std::sqrt(3.0) : 0.0);
        cell_.hasNormals = input_.hasNormal;
        return {};
    }
    void save(ByteWriter& to) const override {
        to.put(rounding_);
        to.put(heights_);
        to.put(surveyed_);
    }
    void load(ByteReader& from) override {
        from.get(rounding_);
        from.get(heights_);
        from.get(surveyed_);
        ByteReader input(surveyed_);
        found_.pointsIn = 0;  // (what was found is found again)
        found_.dropped.clear();
        found_.notes = foundAtOpening_;
        isBroken_ = !input_.load(input, found_);
    }

    // ---- the work ----

    Result<CellProduct> make(const WorkCell& cell, const std::vector<uint8_t>& input,
                             const std::vector<FromBelow>& below) const override {
        STIPPLE_ASSIGN(CellProduct product, buildScanCell(cell, input, below, frame(), subtrees_, cell_, executor_));
        product.isCutShort = cell_.isStopped && cell_.isStopped();
        return product;
    }

    uint64_t take(uint64_t at, const std::vector<uint8_t>& bytes) override { return sums_.add(at, bytes); }

    // ---- the end ----

    Result<Hierarchy> describe(StoreWriter&, StoreDescription& description, BuildReport& report) override {
        Hierarchy h = hierarchyOf(frame(), std::exchange(sums_.tables, {}));
        report.pointsIn = found_.pointsIn;
        report.dropped = found_.dropped;
        report.notes.insert(report.notes.end(), found_.notes.begin(), found_.notes.end());
        report.skippedFiles = found_.skippedFiles;
        if (sums_.duplicate > 0) report.dropped["at the place of another"] = sums_.duplicate;
        report.pointsOut = sums_.kept;
        const double world = unit();
        report.notes.push_back(fmt::format(
            "{} points became {} samples in patches, at most {:.3g} units from them; no "
            "place of a patch is farther than {:.3g} from a point",
            sums_.kept - sums_.counts.left, sums_.counts.samples, sums_.residual * world, sums_.beside * world));
        if (sums_.counts.left > 0)
            report.notes.push_back(counted(sums_.counts.left, "point fits no patch and stays a point",
                                           "points fit no patch and stay points"));
        description = describeInput(input_, settings_.points);
        for (uint32_t n = 0; n < h.nodes.size(); ++n)
            if (h.nodes[n].isLeaf())
                h.forEachPayload(n, [&](uint32_t chunk) { description.points += h.payload(chunk).records; });
        description.pointsIn = report.pointsIn;
        description.patches = report.patches = sums_.counts;
        description.dropped = report.dropped;
        description.roundingUnits = sums_.residual * world;
        description.hasNormals = true;
        description.boundsMin = input_.origin + world * glm::dvec3(sums_.lo);
        description.boundsMax = input_.origin + world * glm::dvec3(sums_.hi);
        setFocus(h, description);
        description.lowHeight = heights_[0];
        description.highHeight = heights_[1];
        description.pointMaterials = {};
        return h;
    }

  private:
    static constexpr uint64_t kSpillBytes = 28;  ///< of a point, between the steps, with its copies
    static constexpr uint64_t kTableBytes = 1;   ///< of a point, of the node table, which stays in memory
    static constexpr uint64_t kReaderBytes = uint64_t{12} << 20;

    /// Bits by which the steps of the build are coarser than those of the input.
    int coarser() const {
        const auto bits = std::bit_width(std::max({input_.greatest[0], input_.greatest[1], input_.greatest[2]}));
        return std::max(static_cast<int>(bits) - 32, 0);
    }
    double unit() const { return std::ldexp(input_.unit, coarser()); }
    /// Of all places, in steps of the build.
    std::array<uint64_t, 3> greatest() const {
        const auto k = static_cast<uint32_t>(coarser());
        return {input_.greatest[0] >> k, input_.greatest[1] >> k, input_.greatest[2] >> k};
    }
    std::array<uint32_t, 3> placeAt(const Points& block, size_t i) const {
        const Place p = block.place(i);
        const auto k = static_cast<uint32_t>(coarser());
        return {static_cast<uint32_t>(p[0] >> k), static_cast<uint32_t>(p[1] >> k), static_cast<uint32_t>(p[2] >> k)};
    }

    /// Records of leaves along an axis, spread over their spheres.
    struct Placed {
        std::vector<std::pair<double, uint64_t>> records;  ///< by place, lattice units
        uint64_t all = 0;
        /// The place that a share of them is below.
        double below(double share) const {
            uint64_t sum = 0;
            for (const auto& [at, count] : records)
                if (sum += count; static_cast<double>(sum) > share * static_cast<double>(all)) return at;
            return records.empty() ? 0 : records.back().first;
        }
    };
    static Placed alongAxis(const Hierarchy& h, const glm::dvec3& axis) {
        Placed out;
        for (uint32_t n = 0; n < h.nodes.size(); ++n) {
            if (!h.nodes[n].isLeaf()) continue;
            uint64_t records = 0;
            h.forEachPayload(n, [&](uint32_t chunk) {
                const Payload& p = h.payload(chunk);
                records += p.kind == Kind::patches ? uint64_t{kRecordsABlock} * p.records : p.records;
            });
            for (const double side : {-1.0, 0.0, 1.0})
                out.records.emplace_back(glm::dot(axis, glm::dvec3(h.nodes[n].centre)) + side * 0.8 * h.nodes[n].radius,
                                         records);
            out.all += 3 * records;
        }
        std::sort(out.records.begin(), out.records.end());
        return out;
    }
    /// One record in 200 lies beyond each edge; what a tenth of the extent more does not reach is stray.
    static void setFocus(const Hierarchy& h, StoreDescription& description) {
        for (int a = 0; a < 3; ++a) {
            glm::dvec3 axis(0);
            axis[a] = 1;
            const Placed along = alongAxis(h, axis);
            const double low = along.below(1.0 / 200), high = along.below(1 - 1.0 / 200);
            const double margin = 0.1 * (high - low), first = description.boundsMin[a], last = description.boundsMax[a];
            description.focusMin[a] = std::clamp(h.origin[a] + h.unit * (low - margin), first, last);
            description.focusMax[a] = std::clamp(h.origin[a] + h.unit * (high + margin), first, last);
        }
    }

    struct Sent {
        uint32_t subtree;
        ScanPoint point;
    };
    void share(const Points& block, const Frame& on, const SubtreeMargins& margins, const CellSender& to,
               std::vector<Sent>& out) const {
        for (size_t i = 0; i < block.size(); ++i) {
            const auto at = placeAt(block, i);
            const ScanPoint p{at[0], at[1], at[2], block.colour[i], block.normal.empty() ? 0 : block.normal[i]};
            const uint32_t own = to.subtreeOf(on.keyOf(p.x, p.y, p.z));
            out.push_back({own, p});
            margins.forEachNear(own, glm::dvec3(p.x, p.y, p.z), [&](uint32_t near) { out.push_back({near, p}); });
        }
    }
    static Result<void> appendAll(const std::vector<std::vector<Sent>>& sent, CellSender& to) {
        std::vector<uint64_t> first(to.subtrees().size() + 1, 0);
        for (const auto& some : sent)
            for (const Sent& s : some) ++first[s.subtree + 1];
        for (size_t a = 1; a < first.size(); ++a) first[a] += first[a - 1];
        std::vector<ScanPoint> points(first.back());
        std::vector<uint64_t> next(first.begin(), first.end() - 1);
        for (const auto& some : sent)
            for (const Sent& s : some) points[next[s.subtree]++] = s.point;
        std::vector<uint8_t> bytes;
        for (size_t a = 0; a + 1 < first.size(); ++a) {
            const uint64_t count = first[a + 1] - first[a];
            if (count == 0) continue;
            bytes.resize(count * sizeof(ScanPoint));
            std::memcpy(bytes.data(), points.data() + first[a], bytes.size());
            STIPPLE_TRY(to.append(a, bytes, count));
        }
        return {};
    }

    PointInput input_;
    BuildReport found_;  ///< of the input
    const ScanBuildSettings& settings_;
    Executor& executor_;
    int workers_ = 1;
    std::vector<std::string> foundAtOpening_ = found_.notes;
    ScanCellSettings cell_;
    std::vector<FarCubes> far_;
    std::vector<uint8_t> surveyed_;
    double rounding_ = 0;
    std::array<double, 2> heights_{};  ///< 2nd and 98th percentile, world units
    bool isBroken_ = false;
    std::vector<Subtree> subtrees_;
    PatchSums sums_;
};

}  // namespace

Result<BuildReport> buildScanStore(const std::vector<std::string>& inputs, const std::string& output,
                                   const ScanBuildSettings& settings, Executor& executor, Progress& progress) {
    BuildReport found;
    STIPPLE_ASSIGN(PointInput input, PointInput::open(inputs, settings.points, found));
    if (settings.samples > mostSamplesOf(input.declared()))
        return fail(
            ErrorKind::usage,
            fmt::format("asks for more samples than patches of {} can have", counted(input.declared(), "point")),
            fmt::format("--patch-samples {}", settings.samples),
            fmt::format("ask for {} at most", mostSamplesOf(input.declared())));
    ScanBuildSettings own = settings;
    own.points.isStopped = forGood(settings.points.isStopped);
    ScanBuild content(std::move(input), std::move(found), own, executor);
    return buildCells(content, output, own.points, executor, progress);
}

}  // namespace stipple::lod
