// What a build has finished, on disk, so that the same command goes on where it was killed. A folder holds the buckets
// and a log of entries; an entry counts only if it is whole.
#pragma once

#include <functional>
#include <optional>
#include <utility>

#include "engine/base/file.h"
#include "lod/builder/build.h"

namespace stipple::lod {

class Journal {
  public:
    enum class What : uint32_t {
        counted,  ///< what lies where is known
        sent,     ///< part of the input is in its places
        ready,    ///< all of it is
        done,     ///< a step of the work: its chunks are in the file
    };
    struct Entry {
        What what{};
        std::vector<uint8_t> payload;
    };
    /// Where the build of `output` keeps what does not fit in memory; `tempFolder` empty: beside the output.
    static std::string folderOf(const std::string& output, const std::string& tempFolder);
    /// Does an interrupted build of that identity lie there?
    static bool isThere(const std::string& folder, uint64_t identity);
    /// Of the build of `output`; makes the folder if it is not there. `identity`: of input and settings. A folder that
    /// holds something else than a build is refused. Only one process at a time.
    static Result<Journal> open(const std::string& folder, const std::string& output, uint64_t identity,
                                Leftovers leftovers);
    Journal(Journal&& other) noexcept;
    Journal& operator=(Journal&&) = delete;
    ~Journal();

    const std::string& folder() const { return folder_; }
    std::string partialPath() const { return output_ + ".partial"; }
    /// Of an earlier run, in order.
    std::vector<Entry> takeEntries() { return std::exchange(entries_, {}); }
    Result<void> append(What what, const std::vector<uint8_t>& payload);
    /// Nothing was kept: whatever lies in the folder is of no use.
    Result<void> restart();
    /// The build is complete.
    void remove();
    /// Says how much temporary space is needed, with what is there already, and fails if there is no room for it.
    Result<void> announce(uint64_t bytes, Progress& progress) const;

  private:
    Journal() = default;
    Result<void> openFile();  ///< lock_ stays -1 if it has to be tried again
    Result<void> take();
    Result<void> readEntries(const InputFile& file);
    Error foreign() const;
    std::string folder_, output_;
    uint64_t identity_ = 0, end_ = 0;
    int lock_ = -1;
    bool isOwn_ = false;  ///< what is in the folder is this build's to remove
    std::vector<Entry> entries_;
};

}  // namespace stipple::lod
