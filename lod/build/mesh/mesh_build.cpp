// A build of triangles as a straight line: survey, count, distribute to octree cells, then cell by cell from the
// deepest up weld, cluster, simplify, write; verify.
#include "lod/build/mesh/mesh_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/base/check.h"
#include "engine/base/hash.h"
#include "engine/base/queue.h"
#include "lod/build/mesh/cell.h"

namespace stipple::lod {
namespace {

constexpr uint64_t kManyRoots = 20'000;              ///< triangles of the coarsest level that are worth a note
constexpr uint64_t kVerifiedNodes = 2048;            ///< at the end of a build; `info --verify` checks all
constexpr uint64_t kBuildVersion = 1;                ///< of what the same input gives
constexpr uint64_t kCellBytes = uint64_t{80} << 20;  ///< that one cell of the work needs at most

/// The tables in the order of the file: coarse before fine.
void writeTables(const std::vector<Group>& groups, const Lattice& lattice, Hierarchy& h) {
    const auto count = static_cast<uint32_t>(groups.size());
    h.origin = lattice.origin;
    h.unit = lattice.unit;
    h.rootLog2 = 24;
    double smallest = 1e300;
    for (const Group& g : groups)
        if (g.error > 0 && g.error < Group::kRootError) smallest = std::min(smallest, g.error);
    h.errors.smallest = smallest < 1e300 ? smallest * 0.9 : 1;
    std::vector<std::vector<uint32_t>> parents(count);
    h.nodes.resize(count);
    h.groups.resize(count);
    for (uint32_t i = 0; i < count; ++i) {
        const Group& g = groups[count - 1 - i];
        h.nodes[i] = g.node;
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

class MeshBuild {
  public:
    MeshBuild(const MeshSource& source, std::string output, const MeshBuildSettings& settings, Executor& executor,
              Progress& progress)
        : source_(source),
          output_(std::move(output)),
          settings_(settings),
          executor_(executor),
          progress_(progress),
          clock_(report_),
          workers_(std::max(executor.threads(), 1)) {}

    Result<BuildReport> run() {
        report_.primitive = "triangle";
        { STIPPLE_ASSIGN(const StoreWriter writer, StoreWriter::create(output_)); }  // can it be written at all?
        STIPPLE_TRY(planMemory());
        const uint64_t identity = source_.identity();
        STIPPLE_ASSIGN(Reduction work, Reduction::open(output_, settings_.limits, identityOf(identity), isOnDisk_));
        work_.emplace(std::move(work));
        report_.isResumed = work_->isResumed();
        if (report_.isResumed) {
            STIPPLE_TRY(restore());
        } else {
            STIPPLE_TRY(distribute());
            if (source_.identity() != identity)
                return fail(ErrorKind::input, "changed while it was read", settings_.description.source,
                            "build again when it is complete");
            STIPPLE_TRY(work_->seal(factsAsBytes(), executor_));
            clock_.ends("distribute");
        }
        const Frame frame = frameOf(facts_.lattice);
        STIPPLE_TRY(work_->run(
            executor_, workers_,
            [&](const WorkCell& cell, const std::vector<uint8_t>& input, const std::vector<FromBelow>& below) {
                return reduceMeshCell(cell, input, below, frame, settings_, executor_);
            },
            [&](uint64_t at, const std::vector<uint8_t>& table) { return take(at, table); }, progress_));
        clock_.ends("build");
        STIPPLE_TRY(finish());
        report_.seconds = clock_.seconds();
        return std::move(report_);
    }

  private:
    Result<void> planMemory() {
        constexpr uint64_t kFixed = uint64_t{96} << 20;
        uint64_t textures = 0;
        for (const TextureImage& t : settings_.textures) textures += 4 * uint64_t{t.rgba.size()} * 2;
        const auto leastFor = [&](int workers) {
            return kFixed + textures + static_cast<uint64_t>(workers) * kCellBytes + source_.triangles * kTableBytes;
        };
        const uint64_t memory = settings_.limits.memoryBytes, small = source_.triangles * 700 + kFixed + textures;
        while (workers_ > 1 && leastFor(workers_) > memory) --workers_;
        const uint64_t least = std::min(leastFor(workers_), small);
        if (least > memory)
            return fail(
                ErrorKind::budget,
                fmt::format("building {} triangles{} needs {} MiB, but --memory allows {} MiB", source_.triangles,
                            textures > 0 ? " with their textures" : "", (least >> 20) + 1, memory >> 20),
                settings_.description.source, fmt::format("give --memory {}M", (least >> 20) + 1));
        const uint64_t room = memory > leastFor(workers_) ? memory - leastFor(workers_) : 0;
        isOnDisk_ = small > memory && source_.triangles * kSpillBytes > room / 2;
        bufferBytes_ = std::clamp<uint64_t>(room / 4, uint64_t{4} << 20, uint64_t{64} << 20);
        return {};
    }
    uint64_t identityOf(uint64_t input) const {
        const auto& d = settings_.description;
        std::string text = fmt::format("{}|{}|{}|{}|{}|{}", kStoreVersion, kBuildVersion, input,
                                       settings_.groupClusters, d.materials.size(), describeAsText(d));
        for (const TextureImage& t : settings_.textures)
            text += fmt::format("|{} {} {}", t.width, t.height, hashBytes(t.rgba.data(), t.rgba.size() * 4));
        return hashBytes(text.data(), text.size());
    }

    // ---- survey, count, distribute ----

    Result<void> distribute() {
        STIPPLE_ASSIGN(const MeshSource::Bounds bounds, source_.survey());
        facts_.lattice = latticeOf(bounds);
        clock_.ends("survey");
        const Frame frame = frameOf(facts_.lattice);
        CellTree tree(frame, source_.triangles);
        do {
            uint64_t done = 0;
            facts_.triangles = 0;
            STIPPLE_TRY(source_.read([&](const TriangleMesh& block) -> Result<void> {
                facts_.triangles += block.indices.size() / 3;
                tree.count(placeBlock(block, facts_.lattice, executor_).centres());
                done += block.indices.size() / 3;
                progress_.update("count", std::min(done, source_.triangles), source_.triangles);
                return work_->checkStopped();
            }));
        } while (tree.split());
        tree.finish();
        clock_.ends("count");
        const std::vector<Atom> atoms = tree.atoms();
        if (atoms.empty())
            return fail(ErrorKind::input, "holds no triangle with an area", settings_.description.source);
        if (const Journal* const journal = work_->journal())
            STIPPLE_TRY(journal->announce(facts_.triangles * kMostSpillBytes + source_.mostTemporaryBytes, progress_));
        work_->plan(atoms);
        return send(frame, tree, atoms);
    }

    static Frame frameOf(const Lattice& lattice) { return makeFrame(lattice.origin, lattice.unit, lattice.largest, 0); }

    /// Each triangle to the atom that holds its centre.
    Result<void> send(const Frame& frame, const CellTree& tree, const std::vector<Atom>& atoms) {
        std::vector<uint32_t> atomOfCell(tree.cells().size());
        for (uint32_t a = 0; a < atoms.size(); ++a)
            for (uint32_t c = 0; c < atoms[a].cells; ++c) atomOfCell[atoms[a].firstCell + c] = a;
        std::vector<Soup> buffers(atoms.size());
        const uint64_t wanted = std::max<uint64_t>(bufferBytes_ / atoms.size(), 8192);
        // What no cell can divide may be one triangle many times: those are dropped before they fill the disk.
        const auto isCrowded = [&](size_t a) { return atoms[a].count > kAtomPoints; };
        std::vector<uint64_t> sent(atoms.size());
        std::atomic<uint64_t> duplicate{0};
        const auto flush = [&](size_t a) {
            Soup& soup = buffers[a];
            // Triangles in any order share few vertices with those beside them.
            if (isCrowded(a) || soup.vertices.size() * 3 > 4 * (soup.indices.size() / 3))
                duplicate += gather(soup, isCrowded(a));
            sent[a] += soup.indices.size() / 3;
            ByteWriter to;
            putSoup(soup, to);
            soup = {};
            return work_->input(a).append(to.bytes());
        };
        uint64_t done = 0;
        STIPPLE_TRY(source_.read([&](const TriangleMesh& block) -> Result<void> {
            const PlacedBlock placed = placeBlock(block, facts_.lattice, executor_);
            facts_.degenerate += placed.degenerate;
            facts_.notFinite += placed.notFinite;
            facts_.rounding = std::max(facts_.rounding, placed.rounding);
            std::vector<uint64_t> order(placed.x.size());  // atom, triangle
            executor_.parallelFor(order.size(), 4096, [&](size_t begin, size_t end) {
                for (size_t t = begin; t < end; ++t)
                    order[t] =
                        uint64_t{atomOfCell[tree.cellOf(frame.keyOf(placed.x[t], placed.y[t], placed.z[t]))]} << 32 | t;
            });
            std::sort(order.begin(), order.end());
            std::vector<size_t> starts;
            for (size_t i = 0; i < order.size(); ++i)
                if (i == 0 || order[i] >> 32 != order[i - 1] >> 32) starts.push_back(i);
            starts.push_back(order.size());
            CompletionQueue<Error> errors;
            executor_.parallelFor(starts.size() - 1, 1, [&](size_t begin, size_t end) {
                std::vector<uint32_t> place(placed.soup.vertices.size(), ~0u);
                for (size_t s = begin; s < end; ++s) {
                    Soup& to = buffers[order[starts[s]] >> 32];
                    std::vector<uint32_t> used;
                    for (size_t i = starts[s]; i < starts[s + 1]; ++i)
                        for (size_t k = 0; k < 3; ++k) {
                            const uint32_t v = placed.soup.indices[3 * (order[i] & 0xffffffffu) + k];
                            if (place[v] == ~0u) {
                                place[v] = static_cast<uint32_t>(to.vertices.size());
                                to.vertices.push_back(placed.soup.vertices[v]);
                                used.push_back(v);
                            }
                            to.indices.push_back(place[v]);
                        }
                    for (const uint32_t v : used) place[v] = ~0u;
                    if (to.vertices.size() * sizeof(shared::MeshVertex) + to.indices.size() * 4 < wanted) continue;
                    if (const auto flushed = flush(order[starts[s]] >> 32); !flushed) errors.push(flushed.error());
                }
            });
            if (const auto found = errors.takeAll(); !found.empty()) return tl::unexpected(found.front());
            done += block.indices.size() / 3;
            progress_.update("distribute", std::min(done, source_.triangles), source_.triangles);
            return work_->checkStopped();
        }));
        for (size_t a = 0; a < buffers.size(); ++a)
            if (!buffers[a].indices.empty()) STIPPLE_TRY(flush(a));
        facts_.duplicate = duplicate;
        if (const uint64_t most = *std::max_element(sent.begin(), sent.end()); most > 2 * kAtomPoints)
            return fail(ErrorKind::budget, fmt::format("{} different triangles have their centre at one place", most),
                        settings_.description.source, "is the mesh what it should be?");
        return {};
    }

    /// What a resumed build has to know.
    struct Facts {
        Lattice lattice;
        uint64_t triangles = 0, degenerate = 0, notFinite = 0, duplicate = 0;
        double rounding = 0;
    };
    std::vector<uint8_t> factsAsBytes() const {
        ByteWriter to;
        to.put(facts_);
        return to.bytes();
    }
    Result<void> restore() {
        ByteReader from(work_->facts());
        from.get(facts_);
        if (!from.isWhole())
            return fail(ErrorKind::input, "holds a damaged journal", work_->journal()->folder(), "delete the folder");
        return work_->restore(progress_);
    }

    // ---- the end ----

    uint64_t take(uint64_t at, const std::vector<uint8_t>& bytes) {
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

    Result<void> finish() {
        Hierarchy hierarchy;
        writeTables(groups_, facts_.lattice, hierarchy);
        groups_ = {};
        STIPPLE_TRY(writeTextures(settings_.textures, work_->writer(), hierarchy, executor_));
        clock_.ends("textures");
        for (const auto& [reason, count] : {std::pair{"degenerate triangles", facts_.degenerate},
                                            std::pair{"duplicate triangles", facts_.duplicate + duplicate_},
                                            std::pair{"triangles that are not finite", facts_.notFinite}})
            if (count > 0) report_.dropped[reason] = count;
        report_.pointsIn = facts_.triangles;
        StoreDescription description = settings_.description;
        description.points = report_.pointsOut = kept_;
        description.pointsIn = report_.pointsIn;
        description.dropped = report_.dropped;
        for (const Node& node : hierarchy.nodes) description.records += node.records;
        description.roundingUnits = facts_.rounding;
        description.boundsMin = description.focusMin = facts_.lattice.origin + facts_.lattice.unit * glm::dvec3(lo_);
        description.boundsMax = description.focusMax = facts_.lattice.origin + facts_.lattice.unit * glm::dvec3(hi_);
        description.hasColour = description.hasNormals = description.isReflectance = true;
        StoreWriter& writer = work_->writer();
        STIPPLE_TRY(writer.finish(hierarchy, description));
        clock_.ends("finish");
        uint64_t coarsest = 0;
        for (size_t i = 0; i < hierarchy.nodes.size(); ++i)
            coarsest += hierarchy.groups[i].parents == 0 ? hierarchy.nodes[i].records : 0;
        report_.nodes = hierarchy.nodes.size();
        hierarchy = {};  // its memory is needed
        STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
        STIPPLE_TRY(verifyStore(store, executor_, report_.nodes > kVerifiedNodes ? kVerifiedNodes : 0));
        clock_.ends("verify");
        report_.bytesOut = writer.bytes();
        STIPPLE_TRY(writer.commit());
        work_->finish();
        report_.temporaryBytes = work_->temporaryBytes() + source_.mostTemporaryBytes;
        report_.records = description.records;
        report_.contentHash = writer.contentHash();
        if (coarsest > kManyRoots)
            report_.notes.push_back(fmt::format(
                "{} triangles cannot be simplified (small separate parts, or edges of open borders): they are "
                "drawn whatever the distance",
                coarsest));
        return {};
    }

    static constexpr uint64_t kSpillBytes = 24;      ///< of a triangle, between the steps
    static constexpr uint64_t kMostSpillBytes = 32;  ///< the same, of faces in random order (measured: 27)
    static constexpr uint64_t kTableBytes = 2;       ///< of a triangle, of the table of groups, which stays in memory

    const MeshSource& source_;
    const std::string output_;
    const MeshBuildSettings& settings_;
    Executor& executor_;
    Progress& progress_;
    BuildReport report_;
    StageClock clock_;
    int workers_;
    bool isOnDisk_ = false;
    uint64_t bufferBytes_ = 0;
    std::optional<Reduction> work_;
    Facts facts_;
    std::vector<Group> groups_;
    uint64_t kept_ = 0, duplicate_ = 0;
    glm::ivec3 lo_{1 << 30}, hi_{-1};
};

}  // namespace

Result<BuildReport> buildMeshStore(const MeshSource& source, const std::string& output,
                                   const MeshBuildSettings& settings, Executor& executor, Progress& progress) {
    return MeshBuild(source, output, settings, executor, progress).run();
}

}  // namespace stipple::lod
