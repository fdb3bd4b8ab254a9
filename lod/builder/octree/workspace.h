// Where a build keeps what lies between its steps: in memory, or in a folder with a journal, so that the same command
// goes on where it was killed. Several ranks share one folder; the first of them keeps the journal.
#pragma once

#include <memory>
#include <optional>

#include "engine/base/ranks.h"
#include "engine/base/spill.h"
#include "lod/builder/octree/journal.h"

namespace stipple::lod {

class Workspace {
  public:
    /// On disk: finds what an interrupted build of the same `identity` (of input and settings) left. All ranks call it.
    static Result<Workspace> open(const std::string& output, const BuildLimits& limits, uint64_t identity,
                                  bool isOnDisk);

    const std::string& output() const { return output_; }
    /// Empty: in memory.
    const std::string& folder() const { return folder_; }
    bool isOnDisk() const { return !folder_.empty(); }
    std::unique_ptr<Spill> spill(const std::string& name) const;

    Ranks* ranks() const { return limits_.ranks; }
    bool isFirst() const { return limits_.ranks == nullptr || limits_.ranks->rank() == 0; }
    /// Is number `i` of something this rank's?
    bool isOwn(size_t i) const { return isOwnOf(limits_.ranks, i); }
    /// What the first rank has, for all.
    std::vector<uint8_t> ofFirst(const std::vector<uint8_t>& mine) const;

    /// Of an earlier run. All ranks know what comes before the work; only the first one its steps.
    std::vector<Journal::Entry> takeEntries() { return std::exchange(entries_, {}); }
    /// By the first rank, if on disk.
    Result<void> note(Journal::What what, const std::vector<uint8_t>& payload);
    /// Says how much temporary space is going to be needed, and fails if there is no room for it.
    Result<void> announce(uint64_t bytes, Progress& progress) const;
    Result<void> checkStopped() const;
    /// Of the first rank, if on disk.
    const std::string& partialPath() const { return partialPath_; }
    Error damaged() const {
        return {ErrorKind::input, "holds a damaged journal", folder_, "begin anew with --restart"};
    }
    /// The build is complete.
    void remove();

  private:
    Workspace(std::string output, BuildLimits limits) : output_(std::move(output)), limits_(std::move(limits)) {}
    std::string output_, folder_, partialPath_;
    BuildLimits limits_;
    std::optional<Journal> journal_;
    std::vector<Journal::Entry> entries_;
    bool isKept_ = false;  ///< something to go on with
};

}  // namespace stipple::lod
