#include "lod/builder/octree/cell_build.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/base/hash.h"
#include "engine/base/numbers.h"

namespace stipple::lod {

// ---- distribution ----

CellSender::CellSender(Workspace& workspace, CellInputs& inputs, const CellContent& content, Executor& executor,
                       Progress& progress, const CellTree& tree, uint64_t bufferBytes, uint64_t blocksSent)
    : workspace_(workspace),
      inputs_(inputs),
      content_(content),
      executor_(executor),
      progress_(progress),
      tree_(tree),
      bufferBytes_(bufferBytes),
      ofCell_(tree.cells().size()),
      blocksSent_(blocksSent) {
    const std::vector<Subtree>& all = inputs.subtrees();
    for (uint32_t a = 0; a < all.size(); ++a)
        for (uint32_t c = 0; c < all[a].cells; ++c) ofCell_[all[a].firstCell + c] = a;
}

Result<void> CellSender::append(size_t subtree, const std::vector<uint8_t>& bytes, uint64_t units, bool isSpread) {
    return inputs_.append(subtree, bytes, units, isSpread);
}

Result<void> CellSender::ends(uint64_t unitsOfBlock, uint64_t unitsOfAll, const std::function<Result<void>()>& flush) {
    constexpr uint64_t kOften = uint64_t{1} << 24, kShare = 8;  // units between notes, and notes at least
    done_ += unitsOfBlock;
    progress_.update("distribute", std::min(done_, unitsOfAll), unitsOfAll);
    if (block_ <= blocksSent_) {
        noted_ = done_;
        return workspace_.checkStopped();
    }
    if (!workspace_.isOnDisk()) return workspace_.checkStopped();
    if (done_ - noted_ >= std::min(kOften, unitsOfAll / kShare)) {
        noted_ = done_;
        STIPPLE_TRY(agree(workspace_.ranks(), flush()));
        STIPPLE_TRY(note(Journal::What::sent));
        STIPPLE_TRY(gatherSpread());
    }
    const uint64_t bytes = inputs_.bytes();
    most_ = std::max<uint64_t>(most_, bytes);
    progress_.setTemporaryBytes(bytes);
    return workspace_.checkStopped();
}

Result<void> CellSender::note(Journal::What what) {
    if (!workspace_.isOnDisk()) return {};
    STIPPLE_TRY(agree(workspace_.ranks(), inputs_.seal(executor_)));
    ByteWriter own, all;
    inputs_.save(own);
    all.put(block_);
    ByteWriter facts;
    content_.save(facts);
    all.put(facts.bytes());
    if (workspace_.ranks() == nullptr) {
        all.put(own.bytes());
    } else {
        std::vector<uint8_t> joined;
        for (const auto& theirs : workspace_.ranks()->gather(own.bytes()))
            joined.insert(joined.end(), theirs.begin(), theirs.end());
        all.put(joined);
        if (what == Journal::What::ready) inputs_.load(joined);
    }
    return agree(workspace_.ranks(), workspace_.note(what, all.bytes()));
}

/// Subtrees whose input takes more room than it must; what they replace goes when the journal knows of it.
Result<void> CellSender::gatherSpread() {
    const uint64_t atOnce = std::max<uint64_t>(uint64_t{1} << 18, inputs_.bytes() / 32);
    std::vector<size_t> spread;
    for (size_t a = 0; a < subtrees().size(); ++a)
        if (isOwn(a) && inputs_.isSpread(a)) spread.push_back(a);
    for (size_t next = 0;;) {
        const auto gatherSome = [&]() -> Result<void> {
            for (uint64_t bytes = 0; next < spread.size() && bytes < atOnce; ++next) {
                const size_t a = spread[next];
                STIPPLE_TRY(workspace_.checkStopped());
                STIPPLE_ASSIGN(const std::vector<uint8_t> input, inputs_.all(a));
                uint64_t units = 0;
                STIPPLE_ASSIGN(const std::vector<uint8_t> fresh, content_.gathered(input, subtrees()[a], units));
                bytes += fresh.size();
                STIPPLE_TRY(inputs_.replace(a, fresh, units));
            }
            return {};
        };
        STIPPLE_TRY(agree(workspace_.ranks(), gatherSome()));
        most_ = std::max<uint64_t>(most_, inputs_.bytes());
        STIPPLE_TRY(note(Journal::What::sent));
        inputs_.dropOld();
        uint64_t isMore = next < spread.size() ? 1 : 0;
        if (workspace_.ranks() != nullptr) {
            std::vector<uint32_t> sum{static_cast<uint32_t>(isMore)};
            workspace_.ranks()->addUp(sum);
            isMore = sum[0];
        }
        if (isMore == 0) return {};
    }
}

namespace {

constexpr uint64_t kVerifiedNodes = 2048;  ///< at the end of a build; `info --verify` checks all

class CellBuild {
  public:
    CellBuild(CellContent& content, std::string output, const BuildLimits& limits, Executor& executor,
              Progress& progress)
        : content_(content),
          output_(std::move(output)),
          limits_(limits),
          executor_(executor),
          progress_(progress),
          clock_(report_),
          workers_(std::max(executor.threads(), 1)) {}

    Result<BuildReport> run() {
        report_.primitive = content_.primitive();
        STIPPLE_TRY(agree(limits_.ranks, tryOutput()));
        STIPPLE_TRY(agree(limits_.ranks, planMemory()));
        identity_ = content_.inputIdentity();
        const std::string settings = fmt::format("{}|{}|{}", kStoreVersion, identity_, content_.settingsAsText());
        STIPPLE_ASSIGN(Workspace opened,
                       Workspace::open(output_, limits_, hashBytes(settings.data(), settings.size()), isOnDisk_));
        workspace_.emplace(std::move(opened));
        inputs_.emplace(*workspace_);
        // (Shares as measured with 300k triangles and 1.2M segments.)
        progress_.plan({{"survey", 3}, {"count", 5}, {"distribute", 7}, {"build", 60}, {"verify", 25}});
        STIPPLE_TRY(agree(limits_.ranks, restore()));
        STIPPLE_TRY(distribute());
        Reduction work(*workspace_, *inputs_, std::move(done_));
        STIPPLE_TRY(work.run(
            executor_, workers_,
            [&](const WorkCell& cell, const std::vector<uint8_t>& input, const std::vector<FromBelow>& below) {
                return content_.make(cell, input, below);
            },
            [&](uint64_t at, const std::vector<uint8_t>& table) { return content_.take(at, table); }, progress_));
        clock_.ends("build");
        report_.temporaryBytes =
            std::max(report_.temporaryBytes, workspace_->isOnDisk() ? work.mostTemporaryBytes() : 0);
        STIPPLE_TRY(agree(limits_.ranks, workspace_->isFirst() ? finish(work.writer()) : Result<void>()));
        report_.seconds = clock_.seconds();
        return std::move(report_);
    }

  private:
    Result<void> tryOutput() const {
        if (limits_.ranks != nullptr && limits_.ranks->rank() > 0) return {};
        STIPPLE_ASSIGN(const StoreWriter writer, StoreWriter::create(output_));
        return {};
    }

    Result<void> planMemory() {
        const MemoryNeeds needs = content_.memory();
        const auto leastFor = [&](int workers) {
            return needs.fixed + std::max(needs.tables + static_cast<uint64_t>(workers) * needs.aWorker, needs.survey);
        };
        const uint64_t memory = limits_.memoryBytes, small = needs.fixed + needs.whole;
        while (workers_ > 1 && leastFor(workers_) > memory) --workers_;
        const uint64_t least = std::min(leastFor(workers_), small);
        if (least > memory) {
            const auto asked = [&](uint64_t bytes) {  // on the command line, in MiB
                return static_cast<double>(bytes) / (1 - needs.readerShare) / (uint64_t{1} << 20);
            };
            const auto wanted = toWhole<uint64_t>(std::ceil(asked(least)) + 1);
            return fail(ErrorKind::budget,
                        fmt::format("building {} needs {} MiB, but --memory allows {} MiB", needs.content, wanted,
                                    toWhole<uint64_t>(std::round(asked(memory)))),
                        content_.source(), fmt::format("give --memory {}M", wanted));
        }
        const uint64_t room = memory > leastFor(workers_) ? memory - leastFor(workers_) : 0;
        isOnDisk_ = limits_.ranks != nullptr || (small > memory && needs.between > room / 2);
        bufferBytes_ = std::clamp<uint64_t>(room / 4, uint64_t{4} << 20, uint64_t{64} << 20);
        return {};
    }

    /// What an earlier run left.
    Result<void> restore() {
        std::vector<Journal::Entry> entries = workspace_->takeEntries();
        report_.isResumed = !entries.empty();
        std::vector<uint8_t> sent;
        for (Journal::Entry& e : entries) switch (e.what) {
                case Journal::What::counted: {
                    ByteReader from(e.payload);
                    content_.load(from);
                    tree_.emplace(content_.frame(), 0);
                    tree_->load(from);
                    if (!from.isWhole()) return tl::unexpected(workspace_->damaged());
                    break;
                }
                case Journal::What::sent:
                case Journal::What::ready:
                    isReady_ = e.what == Journal::What::ready;
                    sent = std::move(e.payload);
                    break;
                case Journal::What::done:
                    done_.push_back(std::move(e));
                    break;
            }
        if (!report_.isResumed) return {};
        if (!tree_) return tl::unexpected(workspace_->damaged());
        inputs_->plan(tree_->subtrees());
        if (!sent.empty()) {
            std::vector<uint8_t> facts, inputs;
            ByteReader from(sent);
            from.get(blocksSent_);
            from.get(facts);
            from.get(inputs);
            ByteReader of(facts);
            content_.load(of);
            if (!from.isWhole() || !of.isWhole() || !inputs_->load(inputs))
                return tl::unexpected(workspace_->damaged());
        }
        progress_.say(isReady_
                          ? fmt::format("going on with the interrupted build: {} cells are done, {} have their input",
                                        done_.size(), inputs_->subtrees().size())
                          : fmt::format("going on with the interrupted build: {} of its input are in their places",
                                        humanBytes(inputs_->bytes())));
        return {};
    }

    Result<void> distribute() {
        if (isReady_) return content_.complete(*inputs_);
        const bool isCounted = tree_.has_value();
        STIPPLE_TRY(agree(limits_.ranks, content_.survey(*workspace_, progress_, isCounted)));
        clock_.ends("survey");
        if (!isCounted) STIPPLE_TRY(agree(limits_.ranks, count()));
        if (workspace_->isOnDisk())
            STIPPLE_TRY(workspace_->announce(
                content_.temporaryBytes(limits_.ranks != nullptr ? limits_.ranks->count() : 1), progress_));
        CellSender sender(*workspace_, *inputs_, content_, executor_, progress_, *tree_, bufferBytes_, blocksSent_);
        const auto send = [&]() -> Result<void> {
            STIPPLE_TRY(content_.send(sender));
            if (content_.inputIdentity() != identity_)
                return fail(ErrorKind::input, "changed while it was read", content_.source(),
                            "build again when it is complete");
            return {};
        };
        STIPPLE_TRY(agree(limits_.ranks, send()));
        STIPPLE_TRY(sender.note(Journal::What::ready));
        STIPPLE_TRY(agree(limits_.ranks, content_.complete(*inputs_)));
        report_.temporaryBytes = sender.mostTemporaryBytes();
        tree_.reset();
        clock_.ends("distribute");
        return {};
    }

    Result<void> count() {
        tree_.emplace(content_.frame(), content_.declared());
        do {
            uint64_t done = 0;
            STIPPLE_TRY(content_.places([&](const Coordinates& places, uint64_t of) -> Result<void> {
                tree_->count(places);
                done += places.size();
                progress_.update("count", std::min(done, of), of);
                return workspace_->checkStopped();
            }));
        } while (tree_->split());
        tree_->finish();
        clock_.ends("count");
        STIPPLE_TRY(content_.check(tree_->subtrees()));
        inputs_->plan(tree_->subtrees());
        ByteWriter to;
        content_.save(to);
        tree_->save(to);
        return workspace_->note(Journal::What::counted, to.bytes());
    }

    Result<void> finish(StoreWriter& writer) {
        StoreDescription description;
        STIPPLE_ASSIGN(Hierarchy hierarchy, content_.describe(writer, description, report_));
        clock_.ends("tables");
        for (const Node& node : hierarchy.nodes) description.records += node.records;
        report_.nodes = hierarchy.nodes.size();
        report_.records = description.records;
        STIPPLE_TRY(writer.finish(hierarchy, description));
        clock_.ends("finish");
        hierarchy = {};  // its memory is needed
        progress_.update("verify", 0, 1);
        STIPPLE_ASSIGN(const Store store, openStore(writer.temporaryPath()));
        STIPPLE_TRY(verifyStore(store, executor_, report_.nodes > kVerifiedNodes ? kVerifiedNodes : 0));
        clock_.ends("verify");
        report_.bytesOut = writer.bytes();
        STIPPLE_TRY(writer.commit());
        workspace_->remove();
        report_.contentHash = writer.contentHash();
        return {};
    }

    CellContent& content_;
    const std::string output_;
    const BuildLimits& limits_;
    Executor& executor_;
    Progress& progress_;
    BuildReport report_;
    StageClock clock_;
    int workers_;
    bool isOnDisk_ = false, isReady_ = false;
    uint64_t bufferBytes_ = 0, identity_ = 0, blocksSent_ = 0;
    std::optional<Workspace> workspace_;
    std::optional<CellInputs> inputs_;
    std::optional<CellTree> tree_;
    std::vector<Journal::Entry> done_;
};

}  // namespace

Result<BuildReport> buildCells(CellContent& content, const std::string& output, const BuildLimits& limits,
                               Executor& executor, Progress& progress) {
    return CellBuild(content, output, limits, executor, progress).run();
}

}  // namespace stipple::lod
