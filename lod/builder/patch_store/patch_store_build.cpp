// Triangles as content of a build (octree/cell_build.h) whose nodes hold patches: each travels to the octree cell of
// its middle, and to those near it; cell by cell from the deepest up, patches are made of them.
#include "lod/builder/patch_store/patch_store_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "engine/base/words.h"
#include "lod/builder/build_version.h"
#include "lod/builder/counts.h"
#include "lod/builder/octree/cell_build.h"
#include "lod/builder/patch_store/division.h"
#include "lod/builder/patch_store/patch_cell.h"
#include "lod/builder/patch_store/subtree_margins.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kCellBytes = uint64_t{160} << 20;  ///< that one cell of the work needs at most
constexpr uint32_t kFewestOfLeaf = 64;                ///< triangles, however many samples are wanted
constexpr double kUsualSamples = 0.5;                 ///< of leaves, for each triangle: one a vertex
constexpr double kFewPieces = 1 << 14;                ///< that dividing may add to small meshes ...
constexpr double kMorePieces = 1.25;                  ///< ... and to large ones, times
constexpr int kPiecesACell = 2;                       ///< log2: an edge is a fourth of the smallest cell's at most

class PatchBuild : public CellContent {
  public:
    PatchBuild(const MeshSource& source, const PatchBuildSettings& settings, Executor& executor)
        : source_(source), settings_(settings), executor_(executor) {
        cell_.coneDegrees = settings.coneDegrees;
        cell_.leafTriangles = settings.leafTriangles;
        cell_.samplesATriangle = kUsualSamples;
        cell_.looks = settings.looks;
        cell_.maps = settings.maps;
        cell_.isStopped = settings.limits.isStopped;
        cell_.hasFineNormals = hasMirrors(settings.description.pointMaterials);
    }

    const char* primitive() const override { return "triangle"; }
    std::string source() const override { return settings_.description.source; }
    uint64_t declared() const override { return source_.triangles; }
    uint64_t inputIdentity() const override { return source_.identity(); }
    MemoryNeeds memory() const override {
        MemoryNeeds needs;
        needs.content = fmt::format("patches of {} triangles", source_.triangles);
        needs.fixed = uint64_t{96} << 20;
        needs.aWorker = kCellBytes;
        needs.tables = source_.triangles * kTableBytes;
        needs.between = source_.triangles * kSpillBytes;
        needs.whole = source_.triangles * 2000;
        needs.readerShare = settings_.readerShare;
        return needs;
    }
    std::string settingsAsText() const override {
        return fmt::format("patches with light|{}|{}|{}|{}|{}|{}|{}|{}", kBuildVersion, settings_.looksIdentity,
                           settings_.maps.any() ? settings_.maps.texels : 1, settings_.coneDegrees, settings_.samples,
                           settings_.leafTriangles, kPatchCells, describeAsText(settings_.description));
    }

    // ---- survey, count, distribute ----

    Result<void> survey(const Workspace& workspace, Progress& progress, bool isKnown) override {
        const auto tell = [&](uint64_t done, uint64_t all) {
            progress.update("survey", std::min(done, all), all);
            return workspace.checkStopped();
        };
        STIPPLE_ASSIGN(const MeshSource::Bounds bounds, source_.survey(tell));
        if (isKnown) return {};
        facts_.lattice = latticeOf(bounds);
        // Vertices a hair apart, as at the poles of a ball, are not told apart by samples either.
        if (facts_.lattice.isWide()) facts_.lattice = latticeOf(bounds, false);
        if (facts_.lattice.isWide())
            return fail(ErrorKind::input, "some of its places lie too far from all others for patches", source(),
                        "leave them out, or build it without --patches");
        facts_.keyLevels = plainFrame().keyLevels;
        EdgeLengths lengths;
        uint64_t triangles = 0;
        STIPPLE_TRY(source_.read([&](const TriangleMesh& block) -> Result<void> {
            lengths.add(placeBlock(block, facts_.lattice, executor_).soup);
            triangles += block.indices.size() / 3;
            return tell(triangles, source_.triangles);
        }));
        const double most = kMorePieces * static_cast<double>(triangles) + kFewPieces;
        while (facts_.keyLevels > 0 && lengths.pieces(longestLog2()) > most) --facts_.keyLevels;
        return {};
    }
    Frame frame() const override {
        Frame f = plainFrame();
        f.keyLevels = facts_.keyLevels;
        return f;
    }
    Result<void> places(const Places& take) override {
        facts_.triangles = facts_.pieces = 0;
        std::vector<uint32_t> x, y, z;
        STIPPLE_TRY(source_.read([&](const TriangleMesh& block) -> Result<void> {
            facts_.triangles += block.indices.size() / 3;
            const PlacedBlock placed = divided(block);
            const size_t count = placed.soup.indices.size() / 3;
            facts_.pieces += count;
            x.clear();
            y.clear();
            z.clear();
            for (size_t t = 0; t < count; ++t) {
                const Steps p = middleOf(placed.soup, t);
                x.push_back(static_cast<uint32_t>(p.x));
                y.push_back(static_cast<uint32_t>(p.y));
                z.push_back(static_cast<uint32_t>(p.z));
            }
            return take({x, y, z}, source_.triangles);
        }));
        facts_.bad = source_.badTriangles ? source_.badTriangles() : 0;
        return {};
    }
    Result<void> check(const std::vector<Subtree>& subtrees) const override {
        if (subtrees.empty()) return fail(ErrorKind::input, "holds no triangle with an area", source());
        for (const Subtree& a : subtrees)
            if (a.count > 4 * kSubtreePoints)
                return fail(ErrorKind::budget,
                            fmt::format("{} triangles lie within the length of a few others", a.count), source(),
                            "divide the long triangles, or build it without --patches");
        return {};
    }
    uint64_t temporaryBytes(int ranks) const override {
        const auto each = static_cast<uint64_t>(ranks);
        return std::max(each * source_.surveyBytes, facts_.pieces * kSpillBytes + each * source_.readBytes);
    }

    /// Each triangle to the subtree that holds its middle, and to those that it lies near.
    Result<void> send(CellSender& to) override {
        const Frame on = frame();
        const SubtreeMargins margins(on, to.subtrees(), kPatchMargin);
        std::vector<Soup> buffers(to.subtrees().size());
        const uint64_t wanted = std::max<uint64_t>(to.bufferBytes() / std::max<size_t>(buffers.size(), 1), 8192);
        const auto flush = [&](size_t a) {
            ByteWriter bytes;
            putSoup(buffers[a], bytes);
            const uint64_t triangles = buffers[a].indices.size() / 3;
            buffers[a] = {};
            return to.append(a, bytes.bytes(), triangles);
        };
        const auto flushAll = [&]() -> Result<void> {
            for (size_t a = 0; a < buffers.size(); ++a)
                if (!buffers[a].indices.empty()) STIPPLE_TRY(flush(a));
            return {};
        };
        const Result<void> read = source_.read([&](const TriangleMesh& block) -> Result<void> {
            const uint64_t triangles = block.indices.size() / 3;
            if (to.begins()) return to.ends(triangles, facts_.triangles, flushAll);
            const PlacedBlock placed = divided(block);
            facts_.degenerate += placed.degenerate;
            facts_.notFinite += placed.notFinite;
            facts_.tooFar += placed.tooFar;
            std::vector<std::pair<uint32_t, uint32_t>> order;  // subtree, triangle
            for (uint32_t t = 0; t < placed.soup.indices.size() / 3; ++t) {
                const Steps p = middleOf(placed.soup, t);
                const glm::u64vec3 at(p);
                const uint32_t own = to.subtreeOf(on.keyOf(at.x, at.y, at.z));
                if (to.isOwn(own)) order.emplace_back(own, t);
                margins.forEachNear(own, glm::dvec3(p), [&](uint32_t near) {
                    if (to.isOwn(near)) order.emplace_back(near, t);
                });
            }
            std::sort(order.begin(), order.end());
            for (size_t first = 0, last = 0; first < order.size(); first = last) {
                const uint32_t a = order[first].first;
                SoupPart part(placed.soup, buffers[a]);
                for (last = first; last < order.size() && order[last].first == a; ++last) part.add(order[last].second);
                const Soup& soup = buffers[a];
                if (soup.vertices.size() * sizeof(shared::MeshVertex) + soup.indices.size() * 4 >= wanted)
                    STIPPLE_TRY(flush(a));
            }
            return to.ends(triangles, facts_.triangles, flushAll);
        });
        return read ? flushAll() : read;
    }
    Result<std::vector<uint8_t>> gathered(const std::vector<uint8_t>& input, const Subtree&, uint64_t&) const override {
        return input;
    }
    Result<void> complete(const CellInputs& inputs) override {
        subtrees_ = inputs.subtrees();
        aimAtSamples();
        // Half a step an axis, and as much each time that an edge was halved.
        cell_.rounding = 0.5 * std::sqrt(3.0) * (2.0 + static_cast<int>(plainFrame().rootLog2) - longestLog2());
        return {};
    }
    void save(ByteWriter& to) const override { to.put(facts_); }
    void load(ByteReader& from) override { from.get(facts_); }

    // ---- the work ----

    Result<CellProduct> make(const WorkCell& cell, const std::vector<uint8_t>& input,
                             const std::vector<FromBelow>& below) const override {
        STIPPLE_ASSIGN(CellProduct product, buildPatchCell(cell, input, below, frame(), subtrees_, cell_, executor_));
        product.isCutShort = cell_.isStopped && cell_.isStopped();
        return product;
    }

    uint64_t take(uint64_t at, const std::vector<uint8_t>& bytes) override { return sums_.add(at, bytes); }

    // ---- the end ----

    Result<Hierarchy> describe(StoreWriter&, StoreDescription& description, BuildReport& report) override {
        Hierarchy h = hierarchyOf(frame(), std::exchange(sums_.tables, {}));
        for (const auto& [reason, count] :
             {std::pair{"degenerate triangles", facts_.degenerate}, std::pair{"duplicate triangles", sums_.duplicate},
              std::pair{"triangles that are not finite", facts_.notFinite}, std::pair{kTooFarOut, facts_.tooFar},
              std::pair{"triangles with a corner that is no vertex", facts_.bad}})
            if (count > 0) report.dropped[reason] = count;
        const double world = facts_.lattice.unit;
        report.pointsIn = facts_.triangles + facts_.bad;
        report.pointsOut = sums_.kept;
        const uint64_t whole = facts_.triangles - facts_.degenerate - facts_.notFinite - facts_.tooFar;
        if (facts_.pieces > whole) report.added["by dividing long ones"] = facts_.pieces - whole;
        // (Middles are rounded: a piece may have no area.)
        if (whole > facts_.pieces) report.dropped["degenerate triangles"] += whole - facts_.pieces;
        report.temporaryBytes = std::max(report.temporaryBytes + source_.readBytes, source_.surveyBytes);
        report.patches = sums_.counts;
        report.notes.push_back(fmt::format("{} in {}, {:.3g} units from the surface at most",
                                           counted(sums_.counts.samples, "sample"),
                                           counted(sums_.counts.patches, "patch", "patches"), sums_.residual * world));
        noteFarLeaves(report);
        if (sums_.counts.left > 0)
            report.notes.push_back(fmt::format(
                "{} no patch: {} for {}", counted(sums_.counts.left, "triangle fits", "triangles fit"),
                counted(sums_.counts.discs, "disc stands", "discs stand"), sums_.counts.left == 1 ? "it" : "them"));
        description = settings_.description;
        forgetUnused(description.pointMaterials);
        for (uint32_t n = 0; n < h.nodes.size(); ++n)
            if (h.nodes[n].isLeaf())
                h.forEachPayload(n, [&](uint32_t chunk) { description.points += h.payload(chunk).records; });
        description.patches = sums_.counts;
        description.pointsIn = report.pointsIn;
        description.dropped = report.dropped;
        description.added = report.added;
        description.roundingUnits = sums_.residual * world;
        description.boundsMin = description.focusMin = facts_.lattice.origin + world * glm::dvec3(sums_.lo);
        description.boundsMax = description.focusMax = facts_.lattice.origin + world * glm::dvec3(sums_.hi);
        description.hasColour = description.hasNormals = description.isReflectance = true;
        for (int a = 0; a < 3; ++a) {
            const double p = description.up[a] * description.boundsMin[a],
                         q = description.up[a] * description.boundsMax[a];
            description.lowHeight += std::min(p, q);
            description.highHeight += std::max(p, q);
        }
        return h;
    }

  private:
    /// That triangles would be nearer, where it is seen in a picture of the whole.
    void noteFarLeaves(BuildReport& report) const {
        constexpr double kAcross = 1000, kSeen = 2;  // pixels
        const double whole = glm::length(glm::dvec3(sums_.hi) - glm::dvec3(sums_.lo));
        const double pixels = whole > 0 ? kAcross * sums_.residual / whole : 0;
        if (pixels <= kSeen) return;
        report.notes.push_back(fmt::format(
            "up to {:.0f} px where a picture shows all of it {:.0f} px across: its triangles, without --patches, are "
            "exact, and --patch-samples N may bring most leaves nearer",
            std::ceil(pixels), kAcross));
    }

    /// Of a grid of materials most are no sample's: a store of rough ones is not to be taken for one with mirrors.
    void forgetUnused(std::vector<PointMaterial>& list) const {
        if (list != materialGrid()) return;
        size_t last = 0;
        for (size_t m = 0; m < list.size(); ++m)
            if (sums_.hasMaterial.at(m) != 0)
                last = m;
            else
                list[m] = {};
        list.resize(last + 1);
    }

    static constexpr uint64_t kSpillBytes = 48;  ///< of a triangle, between the steps, with its copies
    static constexpr uint64_t kTableBytes = 1;   ///< of a triangle, of the node table, which stays in memory

    /// What a resumed build has to know.
    struct Facts {
        Lattice lattice;
        uint64_t triangles = 0, pieces = 0, degenerate = 0, notFinite = 0, tooFar = 0, bad = 0;
        uint32_t keyLevels = 0;
    };

    /// (Of what triangles were divided into there are more than of vertices.)
    void aimAtSamples() {
        cell_.isAsked = settings_.samples > 0;
        if (!cell_.isAsked) return;
        const double times =
            std::max(kUsualSamples * static_cast<double>(facts_.pieces), 1.0) / static_cast<double>(settings_.samples);
        cell_.samplesATriangle = kUsualSamples / times;
        cell_.leafTriangles = static_cast<uint32_t>(
            std::clamp(times * settings_.leafTriangles, double{kFewestOfLeaf}, double{kSubtreePoints}));
    }

    Frame plainFrame() const {
        constexpr double kNear = 16;  // steps, see mesh_build
        return makeFrame(facts_.lattice.origin, facts_.lattice.unit, facts_.lattice.largestKey, 0,
                         facts_.lattice.bits > 24 ? kNear : 0);
    }
    /// Of an edge.
    int longestLog2() const {
        return static_cast<int>(plainFrame().rootLog2) - static_cast<int>(facts_.keyLevels) - kPiecesACell;
    }
    PlacedBlock divided(const TriangleMesh& block) const {
        PlacedBlock placed = placeBlock(block, facts_.lattice, executor_);
        divideLong(placed.soup, std::max(std::exp2(longestLog2()), 2.0));
        return placed;
    }

    const MeshSource& source_;
    const PatchBuildSettings& settings_;
    Executor& executor_;
    PatchCellSettings cell_;
    Facts facts_;
    std::vector<Subtree> subtrees_;
    PatchSums sums_;
};

}  // namespace

Result<BuildReport> buildPatchStore(const MeshSource& source, const std::string& output,
                                    const PatchBuildSettings& settings, Executor& executor, Progress& progress) {
    if (settings.samples > mostSamplesOf(source.triangles))
        return fail(
            ErrorKind::usage,
            fmt::format("asks for more samples than {} of patches can have", counted(source.triangles, "triangle")),
            fmt::format("--patch-samples {}", settings.samples),
            fmt::format("ask for {} at most", mostSamplesOf(source.triangles)));
    PatchBuildSettings own = settings;
    own.limits.isStopped = forGood(settings.limits.isStopped);
    PatchBuild content(source, own, executor);
    return buildCells(content, output, own.limits, executor, progress);
}

}  // namespace stipple::lod
