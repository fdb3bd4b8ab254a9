// Triangles as content of a build (octree/cell_build.h): each travels to the octree cell of its centre; cell by cell
// from the deepest up they are welded, clustered and simplified.
#include "lod/builder/mesh/mesh_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "engine/base/queue.h"
#include "lod/builder/build_version.h"
#include "lod/builder/mesh/cell.h"
#include "lod/builder/mesh/parts.h"
#include "lod/builder/octree/cell_build.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kManyRoots = 20'000;              ///< triangles of the coarsest level that are worth a note
constexpr uint64_t kCellBytes = uint64_t{80} << 20;  ///< that one cell of the work needs at most

/// The tables in the order of the file: coarse before fine.
void writeTables(const std::vector<Group>& groups, const Lattice& lattice, Hierarchy& h) {
    const auto count = static_cast<uint32_t>(groups.size());
    h.origin = lattice.origin;
    h.unit = lattice.unit;
    h.rootLog2 = lattice.bits;
    double smallest = 1e300;
    for (const Group& g : groups)
        if (g.error > 0 && g.error < Group::kRootError) smallest = std::min(smallest, g.error);
    h.errors.smallest = smallest < 1e300 ? smallest * 0.9 : 1;
    std::vector<std::vector<uint32_t>> parents(count);
    h.nodes.resize(count);
    h.groups.resize(count);
    h.isGraph = true;
    for (uint32_t i = 0; i < count; ++i) {
        const Group& g = groups[count - 1 - i];
        h.nodes[i] = g.node;
        setKind(h.nodes[i], Kind::triangles);
        h.nodes[i].group = i;
        h.groups[i] = g.counts;
        h.nodes[i].errorCode =
            static_cast<uint8_t>(g.error >= Group::kRootError ? ErrorScale::kNoParent : h.errors.encodeUp(g.error));
        h.groups[i].firstRun = static_cast<uint32_t>(h.runs.size());
        h.groups[i].runs = static_cast<uint32_t>(g.runs.size());
        h.groups[i].firstTexture = static_cast<uint32_t>(h.groupTextures.size());
        h.groups[i].textures = static_cast<uint32_t>(g.textures.size());
        h.groupTextures.insert(h.groupTextures.end(), g.textures.begin(), g.textures.end());
        for (MeshRun run : g.runs) {
            if (run.producer != MeshRun::kOriginal) {
                run.producer = count - 1 - run.producer;
                parents[run.producer].push_back(i);
            }
            h.runs.push_back(run);
        }
    }
    for (uint32_t i = 0; i < count; ++i) {
        h.groups[i].firstParent = static_cast<uint32_t>(h.parents.size());
        h.groups[i].parents = static_cast<uint32_t>(parents[i].size());
        uint32_t level = 0;
        for (const uint32_t p : parents[i]) level = std::max(level, h.nodes[p].level + 1u);
        h.nodes[i].level = static_cast<uint8_t>(std::min(level, 255u));
        h.nodes[i].parent = parents[i].empty() ? 0 : parents[i][0];
        h.parents.insert(h.parents.end(), parents[i].begin(), parents[i].end());
    }
}

class MeshBuild : public CellContent {
  public:
    MeshBuild(const MeshSource& source, const MeshBuildSettings& settings, Executor& executor)
        : source_(source), settings_(settings), executor_(executor) {}

    const char* primitive() const override { return "triangle"; }
    std::string source() const override { return settings_.description.source; }
    uint64_t declared() const override { return source_.triangles; }
    uint64_t inputIdentity() const override { return source_.identity(); }
    MemoryNeeds memory() const override {
        uint64_t textures = 0;
        for (const TextureImage& t : settings_.textures) textures += 4 * uint64_t{t.rgba.size()} * 2;
        MemoryNeeds needs;
        needs.content = fmt::format("{} triangles{}", source_.triangles, textures > 0 ? " with their textures" : "");
        needs.fixed = (uint64_t{96} << 20) + textures;
        needs.aWorker = kCellBytes;
        needs.tables = source_.triangles * kTableBytes;
        needs.between = source_.triangles * kSpillBytes;
        needs.survey = partBytes();
        needs.whole = source_.triangles * 700;
        needs.readerShare = settings_.readerShare;
        return needs;
    }
    std::string settingsAsText() const override {
        const auto& d = settings_.description;
        std::string text =
            fmt::format("{}|{}|{}|{}", kBuildVersion, settings_.groupClusters, d.materials.size(), describeAsText(d));
        for (const TextureImage& t : settings_.textures)
            text += fmt::format("|{} {} {}", t.width, t.height, hashBytes(t.rgba.data(), t.rgba.size() * 4));
        return text;
    }

    // ---- survey, count, distribute ----

    Result<void> survey(const Workspace& workspace, Progress& progress, bool) override {
        const auto tell = [&](uint64_t done, uint64_t all) {
            progress.update("survey", std::min(done, all), all);
            return workspace.checkStopped();
        };
        STIPPLE_ASSIGN(const MeshSource::Bounds bounds, source_.survey(tell));
        facts_.lattice = latticeOf(bounds);
        return findParts();
    }
    Frame frame() const override { return frameOf(facts_.lattice); }
    Result<void> places(const Places& take) override {
        facts_.triangles = 0;
        size_t number = 0;
        STIPPLE_TRY(forBlocks(Placed::positions, 0, [&](PlacedBlock& placed) -> Result<void> {
            facts_.triangles += placed.given;
            if (!parts_.place(placed, number++)) return changed();
            return take(placed.centres(), source_.triangles);
        }));
        facts_.bad = source_.badTriangles ? source_.badTriangles() : 0;
        return {};
    }
    Result<void> check(const std::vector<Subtree>& subtrees) const override {
        if (!subtrees.empty()) return {};
        // Scans are written with faces, too, which may all be empty.
        const bool isPly = source().find(".ply") != std::string::npos;
        return fail(ErrorKind::input, "holds no triangle with an area", source(),
                    isPly ? "--only-points takes its vertices, as points" : "");
    }
    uint64_t temporaryBytes(int ranks) const override {
        const auto each = static_cast<uint64_t>(ranks);
        return std::max(each * source_.surveyBytes, facts_.triangles * kMostSpillBytes + each * source_.readBytes);
    }

    /// Each triangle to the subtree that holds its centre.
    Result<void> send(CellSender& to) override {
        const Frame frame = frameOf(facts_.lattice);
        const std::vector<Subtree>& subtrees = to.subtrees();
        std::vector<Soup> buffers(subtrees.size());
        size_t number = 0;
        const uint64_t wanted = std::max<uint64_t>(to.bufferBytes() / subtrees.size(), 8192);
        const auto flush = [&](size_t a) {
            Soup& soup = buffers[a];
            const bool isSpread = isScattered(soup);
            if (isSpread || isCrowded(subtrees[a])) gather(soup, isCrowded(subtrees[a]));
            ByteWriter bytes;
            putSoup(soup, bytes);
            const uint64_t triangles = soup.indices.size() / 3;
            soup = {};
            return to.append(a, bytes.bytes(), triangles, isSpread);
        };
        const auto flushAll = [&]() -> Result<void> {
            for (size_t a = 0; a < buffers.size(); ++a)
                if (!buffers[a].indices.empty()) STIPPLE_TRY(flush(a));
            return {};
        };
        STIPPLE_TRY(forBlocks(Placed::all, to.blocksSent(), [&](PlacedBlock& placed) -> Result<void> {
            const uint64_t triangles = placed.given;
            const size_t here = number++;
            if (to.begins()) return to.ends(triangles, facts_.triangles, flushAll);
            if (!parts_.place(placed, here)) return changed();
            facts_.degenerate += placed.degenerate;
            facts_.notFinite += placed.notFinite;
            facts_.tooFar += placed.tooFar;
            facts_.rounding = std::max(facts_.rounding, placed.rounding);
            std::vector<uint64_t> order(placed.x.size());  // subtree, triangle
            executor_.parallelFor(order.size(), 4096, [&](size_t begin, size_t end) {
                for (size_t t = begin; t < end; ++t)
                    order[t] = uint64_t{to.subtreeOf(frame.keyOf(placed.centres().at(t)))} << 32 | t;
            });
            std::erase_if(order, [&](uint64_t o) { return !to.isOwn(o >> 32); });
            std::sort(order.begin(), order.end());
            std::vector<size_t> starts;
            for (size_t i = 0; i < order.size(); ++i)
                if (i == 0 || order[i] >> 32 != order[i - 1] >> 32) starts.push_back(i);
            const size_t runs = starts.size();
            starts.push_back(order.size());
            CompletionQueue<Error> errors;
            executor_.parallelFor(runs, 1, [&](size_t begin, size_t end) {
                std::vector<uint32_t> place(placed.soup.vertices.size(), ~0u);
                for (size_t s = begin; s < end; ++s) {
                    Soup& soup = buffers[order[starts[s]] >> 32];
                    std::vector<uint32_t> used;
                    for (size_t i = starts[s]; i < starts[s + 1]; ++i)
                        for (size_t k = 0; k < 3; ++k) {
                            const uint32_t v = placed.soup.indices[3 * (order[i] & 0xffffffffu) + k];
                            if (place[v] == ~0u) {
                                place[v] = static_cast<uint32_t>(soup.vertices.size());
                                soup.vertices.add(placed.soup.vertices, v);
                                used.push_back(v);
                            }
                            soup.indices.push_back(place[v]);
                        }
                    for (const uint32_t v : used) place[v] = ~0u;
                    if (soup.vertices.size() * sizeof(shared::MeshVertex) + soup.indices.size() * 4 < wanted) continue;
                    if (const auto flushed = flush(order[starts[s]] >> 32); !flushed) errors.push(flushed.error());
                }
            });
            if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
            return to.ends(triangles, facts_.triangles, flushAll);
        }));
        parts_ = PartFinder();
        return flushAll();
    }

    Result<std::vector<uint8_t>> gathered(const std::vector<uint8_t>& input, const Subtree& subtree,
                                          uint64_t& units) const override {
        Soup soup;
        ByteReader from(input);
        while (!from.isWhole()) {
            if (!getSoup(from, soup)) return fail(ErrorKind::input, "a temporary file is damaged", source());
            // What no cell can divide may be one triangle many times.
            if (isCrowded(subtree) && soup.indices.size() / 3 > 2 * kMostOfSubtree) {
                gather(soup, true);
                if (soup.indices.size() / 3 > kMostOfSubtree) return tooMany(soup.indices.size() / 3);
            }
        }
        gather(soup, isCrowded(subtree));
        units = soup.indices.size() / 3;
        ByteWriter to;
        putSoup(soup, to);
        return to.bytes();
    }

    Result<void> complete(const CellInputs& inputs) override {
        uint64_t sent = 0, most = 0;
        for (size_t a = 0; a < inputs.subtrees().size(); ++a) {
            sent += inputs.units(a);
            most = std::max(most, inputs.units(a));
        }
        facts_.duplicate = facts_.triangles - facts_.degenerate - facts_.notFinite - facts_.tooFar - sent;
        return most > kMostOfSubtree ? Result<void>(tooMany(most)) : Result<void>();
    }

    void save(ByteWriter& to) const override { to.put(facts_); }
    void load(ByteReader& from) override { from.get(facts_); }

    // ---- the work ----

    Result<CellProduct> make(const WorkCell& cell, const std::vector<uint8_t>& input,
                             const std::vector<FromBelow>& below) const override {
        return reduceMeshCell(cell, input, below, frameOf(facts_.lattice), facts_.lattice, settings_, executor_);
    }

    uint64_t take(uint64_t at, const std::vector<uint8_t>& bytes) override {
        const uint64_t label = groups_.size();
        CellTable table;
        ByteReader from(bytes);
        STIPPLE_CHECK(table.get(from), "the table of a cell");
        for (Group& g : table.groups) {
            g.node.chunkOffset += at;
            for (MeshRun& run : g.runs)
                if (run.producer != MeshRun::kOriginal && (run.producer & Group::kOwn) != 0)
                    run.producer = static_cast<uint32_t>(label) + (run.producer & ~Group::kOwn);
            groups_.push_back(std::move(g));
        }
        kept_ += table.triangles;
        duplicate_ += table.duplicate;
        if (table.triangles > 0) {
            lo_ = glm::min(lo_, table.lo);
            hi_ = glm::max(hi_, table.hi);
        }
        return label;
    }

    // ---- the end ----

    Result<Hierarchy> describe(StoreWriter& writer, StoreDescription& description, BuildReport& report) override {
        Hierarchy hierarchy;
        writeTables(groups_, facts_.lattice, hierarchy);
        groups_ = {};
        STIPPLE_TRY(writeTextures(settings_.textures, cutoffsOf(settings_.description, settings_.textures.size()),
                                  writer, hierarchy, executor_));
        for (const auto& [reason, count] :
             {std::pair{"degenerate triangles", facts_.degenerate},
              std::pair{"duplicate triangles", facts_.duplicate + duplicate_},
              std::pair{"triangles that are not finite", facts_.notFinite}, std::pair{kTooFarOut, facts_.tooFar},
              std::pair{"triangles with a corner that is no vertex", facts_.bad}})
            if (count > 0) report.dropped[reason] = count;
        report.pointsIn = facts_.triangles + facts_.bad;
        report.temporaryBytes = std::max(report.temporaryBytes + source_.readBytes, source_.surveyBytes);
        description = settings_.description;
        description.points = report.pointsOut = kept_;
        description.pointsIn = report.pointsIn;
        description.dropped = report.dropped;
        description.roundingUnits = facts_.rounding;
        description.boundsMin = description.focusMin = facts_.lattice.origin + facts_.lattice.unit * glm::dvec3(lo_);
        description.boundsMax = description.focusMax = facts_.lattice.origin + facts_.lattice.unit * glm::dvec3(hi_);
        if (facts_.lattice.isWide()) {
            const glm::dvec3 low = glm::max(description.boundsMin, facts_.lattice.focusLow);
            const glm::dvec3 high = glm::min(description.boundsMax, facts_.lattice.focusHigh);
            // What most vertices span may hold no triangle that is kept: theirs may be without an area.
            if (glm::all(glm::lessThanEqual(low, high))) {
                description.focusMin = low;
                description.focusMax = high;
            }
        }
        description.hasColour = description.hasNormals = description.isReflectance = true;
        uint64_t coarsest = 0;
        for (size_t i = 0; i < hierarchy.nodes.size(); ++i)
            coarsest += hierarchy.groups[i].parents == 0 ? hierarchy.nodes[i].records : 0;
        if (coarsest > kManyRoots)
            report.notes.push_back(fmt::format(
                "{} triangles cannot be simplified (small separate parts, or edges of open borders): they are "
                "drawn whatever the distance",
                coarsest));
        return hierarchy;
    }

  private:
    static constexpr uint64_t kSpillBytes = 24;      ///< of a triangle, between the steps
    static constexpr uint64_t kMostSpillBytes = 32;  ///< the same at most (measured: 7 to 27)
    static constexpr uint64_t kTableBytes = 2;       ///< of a triangle, of the table of groups, which stays in memory
    static constexpr uint64_t kMostOfSubtree = 2 * kSubtreePoints;

    /// A PLY file says how many faces it has, which may have four corners: twice that is declared.
    bool mayHaveParts() const { return source_.triangles <= 2 * PartFinder::kMostTriangles; }
    /// That looking for parts takes.
    uint64_t partBytes() const {
        if (!mayHaveParts()) return 0;
        const uint64_t triangles = std::min(source_.triangles, PartFinder::kMostTriangles),
                       vertices = source_.vertices > 0 ? std::min(source_.vertices, 3 * triangles) : 3 * triangles;
        return PartFinder::memory(triangles, vertices);
    }
    /// What is small and stands alone stays together (parts.h), if the mesh can be looked at as a whole.
    Result<void> findParts() {
        bool isKnown = mayHaveParts();
        parts_ = PartFinder(facts_.lattice);
        if (isKnown) {
            const Result<void> read = forBlocks(Placed::positions, 0, [&](PlacedBlock& placed) -> Result<void> {
                isKnown = parts_.add(placed);
                if (!isKnown) return fail(ErrorKind::budget, "too many triangles to look for parts", source());
                return {};
            });
            if (isKnown && !read) return read;  // otherwise reading has ended early
        }
        parts_.finish(isKnown);
        return {};
    }

    Result<void> forBlocks(Placed what, uint64_t unplaced,
                           const std::function<Result<void>(PlacedBlock& block)>& use) const {
        return forPlacedBlocks(source_, facts_.lattice, executor_, what, unplaced, use);
    }

    static Frame frameOf(const Lattice& lattice) {
        constexpr double kNear = 16;  // steps: where few vertices are far out, all others may lie within few key cells
        return makeFrame(lattice.origin, lattice.unit, lattice.largestKey, 0, lattice.bits > 24 ? kNear : 0);
    }
    /// Triangles in any order share few vertices with those beside them.
    static bool isScattered(const Soup& soup) { return soup.vertices.size() * 3 > 4 * (soup.indices.size() / 3); }
    /// More have their centre in one place than a cell holds.
    static bool isCrowded(const Subtree& subtree) { return subtree.count > kSubtreePoints; }
    tl::unexpected<Error> changed() const {
        return fail(ErrorKind::input, "changed while it was read", source(), "build again when it is complete");
    }
    tl::unexpected<Error> tooMany(uint64_t triangles) const {
        return fail(ErrorKind::budget, fmt::format("{} different triangles have their centre at one place", triangles),
                    source(), "is the mesh what it should be?");
    }

    /// What a resumed build has to know.
    struct Facts {
        Lattice lattice;
        uint64_t triangles = 0, degenerate = 0, notFinite = 0, tooFar = 0, duplicate = 0, bad = 0;
        double rounding = 0;
    };

    const MeshSource& source_;
    const MeshBuildSettings& settings_;
    Executor& executor_;
    Facts facts_;
    PartFinder parts_;
    std::vector<Group> groups_;
    uint64_t kept_ = 0, duplicate_ = 0;
    Steps lo_{std::numeric_limits<int64_t>::max()}, hi_{std::numeric_limits<int64_t>::min()};
};

}  // namespace

Result<BuildReport> buildMeshStore(const MeshSource& source, const std::string& output,
                                   const MeshBuildSettings& settings, Executor& executor, Progress& progress) {
    MeshBuild content(source, settings, executor);
    return buildCells(content, output, settings.limits, executor, progress);
}

}  // namespace stipple::lod
