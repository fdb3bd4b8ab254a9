#include "lod/builder/octree/workspace.h"

#include <fmt/format.h>

#include <filesystem>

#include "lod/builder/octree/bytes.h"

namespace stipple::lod {

Result<Workspace> Workspace::open(const std::string& output, const BuildLimits& limits, uint64_t identity,
                                  bool isOnDisk) {
    Workspace w(output, limits);
    const std::string folder = Journal::folderOf(output, limits.tempFolder);
    // (With more memory than before, an interrupted build goes on all the same.)
    const bool isFresh = limits.leftovers == Leftovers::replace;
    if (!isOnDisk && (isFresh || !Journal::isThere(folder, identity))) {
        std::error_code none;
        if (isFresh && w.isFirst() && std::filesystem::exists(folder, none))
            STIPPLE_TRY(Journal::open(folder, output, identity, limits.leftovers));  // which goes again
        return w;
    }
    w.folder_ = folder;
    const auto openJournal = [&]() -> Result<void> {
        STIPPLE_ASSIGN(Journal journal, Journal::open(w.folder_, output, identity, limits.leftovers));
        w.journal_.emplace(std::move(journal));
        w.entries_ = w.journal_->takeEntries();
        w.isKept_ = !w.entries_.empty();
        w.partialPath_ = w.journal_->partialPath();
        return {};
    };
    STIPPLE_TRY(agree(limits.ranks, w.isFirst() ? openJournal() : Result<void>()));
    if (limits.ranks == nullptr) return w;
    std::error_code error;
    const bool isSeen = std::filesystem::exists(w.folder_, error);
    const Result<void> seen =
        isSeen ? Result<void>()
               : Result<void>(fail(ErrorKind::output, fmt::format("is not there for rank {}", limits.ranks->rank()),
                                   w.folder_, "--temp must name a folder that all ranks see"));
    STIPPLE_TRY(agree(limits.ranks, seen));
    ByteWriter mine;
    if (w.isFirst())
        for (const Journal::Entry& e : w.entries_) {
            if (e.what == Journal::What::done) break;
            mine.put(e.what);
            mine.put(e.payload);
        }
    const std::vector<uint8_t> bytes = w.ofFirst(mine.bytes());
    for (ByteReader from(bytes); !w.isFirst() && !from.isWhole();) {
        Journal::Entry& e = w.entries_.emplace_back();
        from.get(e.what);
        from.get(e.payload);
        if (from.isBroken()) return tl::unexpected(w.damaged());
    }
    return w;
}

std::unique_ptr<Spill> Workspace::spill(const std::string& name) const {
    return std::make_unique<Spill>(isOnDisk() ? folder_ + "/" + name : "");
}

std::vector<uint8_t> Workspace::ofFirst(const std::vector<uint8_t>& mine) const {
    if (limits_.ranks == nullptr) return mine;
    return limits_.ranks->gather(isFirst() ? mine : std::vector<uint8_t>()).front();
}

Result<void> Workspace::note(Journal::What what, const std::vector<uint8_t>& payload) {
    isKept_ = isOnDisk();
    return journal_ ? journal_->append(what, payload) : Result<void>();
}

Result<void> Workspace::announce(uint64_t bytes, Progress& progress) const {
    return agree(limits_.ranks, journal_ ? journal_->announce(bytes, progress) : Result<void>());
}

Result<void> Workspace::checkStopped() const {
    if (!limits_.isStopped || !limits_.isStopped()) return {};
    return fail(ErrorKind::interrupted, "interrupted", output_,
                isKept_ ? "run the same command again to go on" : "nothing was written");
}

void Workspace::remove() {
    if (journal_) journal_->remove();
}

}  // namespace stipple::lod
