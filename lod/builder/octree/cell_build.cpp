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

class CellStages final : public BuildStages {
  public:
    CellStages(CellContent& content, Course& course) : content_(content), course_(course) {
        course.report.primitive = content.primitive();
    }

    Result<Planned> planMemory() override {
        const MemoryNeeds needs = content_.memory();
        const auto leastFor = [&](int workers) {
            return needs.fixed + std::max(needs.tables + static_cast<uint64_t>(workers) * needs.aWorker, needs.survey);
        };
        const uint64_t memory = course_.limits.memoryBytes, small = needs.fixed + needs.whole;
        while (course_.workers > 1 && leastFor(course_.workers) > memory) --course_.workers;
        const uint64_t least = std::min(leastFor(course_.workers), small);
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
        const uint64_t room = memory > leastFor(course_.workers) ? memory - leastFor(course_.workers) : 0;
        const bool isOnDisk = course_.limits.ranks != nullptr || (small > memory && needs.between > room / 2);
        bufferBytes_ = std::clamp<uint64_t>(room / 4, uint64_t{4} << 20, uint64_t{64} << 20);
        identity_ = content_.inputIdentity();
        return Planned{isOnDisk};
    }
    uint64_t identity() const override {
        const std::string settings = fmt::format("{}|{}|{}", kStoreVersion, identity_, content_.settingsAsText());
        return hashBytes(settings.data(), settings.size());
    }
    Result<Distributed> distribute(Workspace& workspace, const Planned&, std::vector<Journal::Entry> left) override {
        workspace_ = &workspace;
        inputs_.emplace(workspace);
        Distributed out;
        STIPPLE_TRY(agree(ranks(), restore(std::move(left), out.done)));
        if (isReady_)
            STIPPLE_TRY(content_.complete(*inputs_));
        else
            STIPPLE_TRY(send());
        return out;
    }
    Result<Built> build(Workspace& workspace, Distributed distributed) override {
        work_.emplace(workspace, *inputs_, std::move(distributed.done));
        STIPPLE_TRY(work_->run(
            course_.executor, course_.workers,
            [&](const WorkCell& cell, const std::vector<uint8_t>& input, const std::vector<FromBelow>& below) {
                return content_.make(cell, input, below);
            },
            [&](uint64_t at, const std::vector<uint8_t>& table) { return content_.take(at, table); },
            course_.progress));
        course_.clock.ends("build");
        course_.report.temporaryBytes =
            std::max(course_.report.temporaryBytes, workspace.isOnDisk() ? work_->mostTemporaryBytes() : 0);
        return Built{workspace.isFirst() ? &work_->writer() : nullptr};
    }
    Result<Described> describe(const Built& built) override {
        Described out;
        STIPPLE_ASSIGN(out.hierarchy, content_.describe(*built.writer, out.description, course_.report));
        return out;
    }
    uint64_t verifiedNodes() const override { return 2048; }

  private:
    Ranks* ranks() const { return course_.limits.ranks; }

    /// What an earlier run left.
    Result<void> restore(std::vector<Journal::Entry> left, std::vector<Journal::Entry>& done) {
        std::vector<uint8_t> sent;
        for (Journal::Entry& e : left) switch (e.what) {
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
                    done.push_back(std::move(e));
                    break;
            }
        if (left.empty()) return {};
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
        course_.progress.say(
            isReady_ ? fmt::format("going on with the interrupted build: {} cells are done, {} have their input",
                                   done.size(), inputs_->subtrees().size())
                     : fmt::format("going on with the interrupted build: {} of its input are in their places",
                                   humanBytes(inputs_->bytes())));
        return {};
    }

    Result<void> send() {
        const bool isCounted = tree_.has_value();
        STIPPLE_TRY(agree(ranks(), content_.survey(*workspace_, course_.progress, isCounted)));
        course_.clock.ends("survey");
        if (!isCounted) STIPPLE_TRY(agree(ranks(), count()));
        if (workspace_->isOnDisk())
            STIPPLE_TRY(workspace_->announce(content_.temporaryBytes(ranks() != nullptr ? ranks()->count() : 1),
                                             course_.progress));
        CellSender sender(*workspace_, *inputs_, content_, course_.executor, course_.progress, *tree_, bufferBytes_,
                          blocksSent_);
        const auto sendAll = [&]() -> Result<void> {
            STIPPLE_TRY(content_.send(sender));
            if (content_.inputIdentity() != identity_)
                return fail(ErrorKind::input, "changed while it was read", content_.source(),
                            "build again when it is complete");
            return {};
        };
        STIPPLE_TRY(agree(ranks(), sendAll()));
        STIPPLE_TRY(sender.note(Journal::What::ready));
        STIPPLE_TRY(agree(ranks(), content_.complete(*inputs_)));
        course_.report.temporaryBytes = sender.mostTemporaryBytes();
        tree_.reset();
        course_.clock.ends("distribute");
        return {};
    }

    Result<void> count() {
        tree_.emplace(content_.frame(), content_.declared());
        do {
            std::atomic<uint64_t> done{0};
            STIPPLE_TRY(content_.places([&](const Coordinates& places, uint64_t of) -> Result<void> {
                tree_->count(places);
                course_.progress.update("count", std::min(done += places.size(), of), of);
                return workspace_->checkStopped();
            }));
        } while (tree_->split());
        tree_->finish();
        course_.clock.ends("count");
        STIPPLE_TRY(content_.check(tree_->subtrees()));
        inputs_->plan(tree_->subtrees());
        ByteWriter to;
        content_.save(to);
        tree_->save(to);
        return workspace_->note(Journal::What::counted, to.bytes());
    }

    CellContent& content_;
    Course& course_;
    bool isReady_ = false;
    uint64_t bufferBytes_ = 0, identity_ = 0, blocksSent_ = 0;
    Workspace* workspace_ = nullptr;
    std::optional<CellInputs> inputs_;
    std::optional<CellTree> tree_;
    std::optional<Reduction> work_;
};

}  // namespace

Result<BuildReport> buildCells(CellContent& content, const std::string& output, const BuildLimits& limits,
                               Executor& executor, Progress& progress) {
    // (Shares as measured with 300k triangles and 1.2M segments.)
    return runCourse(output, limits, executor, progress,
                     {{"survey", 3}, {"count", 5}, {"distribute", 7}, {"build", 60}, {"verify", 25}},
                     [&](Course& course) -> Result<std::unique_ptr<BuildStages>> {
                         return std::make_unique<CellStages>(content, course);
                     });
}

}  // namespace stipple::lod
