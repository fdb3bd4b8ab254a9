#include "lod/build/octree/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "engine/base/hash.h"

namespace stipple::lod {
namespace fs = std::filesystem;
namespace {

constexpr uint64_t kHeadBytes = 16;
constexpr uint64_t kMagic = 0x32444c4942505453ull;  // "STPBILD2"

struct EntryHead {
    uint64_t bytes = 0, hash = 0;
    Journal::What what{};
    uint32_t unused = 0;
};

}  // namespace

Journal::Journal(Journal&& other) noexcept
    : folder_(std::move(other.folder_)),
      output_(std::move(other.output_)),
      identity_(other.identity_),
      end_(other.end_),
      lock_(std::exchange(other.lock_, -1)),
      entries_(std::move(other.entries_)) {}
Journal::~Journal() {
    if (lock_ < 0) return;
    if (end_ <= kHeadBytes) remove();  // nothing to go on with
    ::close(lock_);
}

std::string Journal::folderOf(const std::string& output, const std::string& tempFolder) {
    const fs::path out = fs::absolute(output);
    const fs::path folder = tempFolder.empty() ? out.parent_path() : fs::path(tempFolder);
    return (folder / (out.filename().string() + ".build")).string();
}

bool Journal::isThere(const std::string& folder, uint64_t identity) {
    std::error_code error;
    if (!fs::exists(folder + "/journal", error)) return false;
    const auto file = InputFile::open(folder + "/journal");
    std::array<uint64_t, 2> head{};
    return file && file->sizeBytes() > kHeadBytes && file->readAt(0, head.data(), sizeof(head)) && head[0] == kMagic &&
           head[1] == identity;
}

Result<Journal> Journal::open(const std::string& folder, const std::string& output, uint64_t identity) {
    Journal j;
    j.folder_ = folder;
    j.output_ = output;
    j.identity_ = identity;
    std::error_code error;
    fs::create_directories(folder, error);
    const std::string path = folder + "/journal";
    j.lock_ = error ? -1 : ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (j.lock_ < 0)
        return fail(ErrorKind::output,
                    fmt::format("cannot be written: {}", error ? error.message() : std::strerror(errno)), folder,
                    "name a folder for temporary files with --temp");
    bool isOurs = false;  // a build that was just killed may take a moment to be gone
    for (int attempt = 0; attempt < 30 && !isOurs; ++attempt) {
        if (attempt > 0) std::this_thread::sleep_for(std::chrono::milliseconds(100));
        isOurs = ::flock(j.lock_, LOCK_EX | LOCK_NB) == 0;
    }
    if (!isOurs)
        return fail(ErrorKind::output, "is in use by another build", folder, "wait for it, or build to another file");
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    std::array<uint64_t, 2> head{};
    if (file.sizeBytes() < sizeof(head)) {
        STIPPLE_TRY(j.restart());
        return j;
    }
    STIPPLE_TRY(file.readAt(0, head.data(), sizeof(head)));
    j.end_ = sizeof(head);
    for (EntryHead entry{}; j.end_ + sizeof(entry) <= file.sizeBytes();) {
        STIPPLE_TRY(file.readAt(j.end_, &entry, sizeof(entry)));
        if (entry.bytes > file.sizeBytes() - j.end_ - sizeof(entry)) break;
        std::vector<uint8_t> payload(entry.bytes);
        STIPPLE_TRY(file.readAt(j.end_ + sizeof(entry), payload.data(), payload.size()));
        if (hashBytes(payload.data(), payload.size()) != entry.hash) break;
        j.entries_.push_back({entry.what, std::move(payload)});
        j.end_ += sizeof(entry) + entry.bytes;
    }
    const bool isOfOtherProgram = head[0] != kMagic && file.sizeBytes() > sizeof(head);
    if (isOfOtherProgram || (head[1] != identity && !j.entries_.empty()))
        return fail(ErrorKind::input, "holds an interrupted build of other input or with other settings", folder,
                    "finish it with the same command as before, or delete the folder");
    // Killed after the store was complete and before this folder was gone: there is nothing to go on with.
    const bool isOver =
        !j.entries_.empty() && j.entries_.back().what == What::done && !fs::exists(j.partialPath(), error);
    if (j.entries_.empty() || isOver) STIPPLE_TRY(j.restart());
    return j;
}

Result<void> Journal::append(What what, const std::vector<uint8_t>& payload) {
    const std::string path = folder_ + "/journal";
    const EntryHead head{payload.size(), hashBytes(payload.data(), payload.size()), what, 0};
    STIPPLE_TRY(writeFileAt(path, end_ + sizeof(head), payload.data(), payload.size()));
    STIPPLE_TRY(writeFileAt(path, end_, &head, sizeof(head)));
    end_ += sizeof(head) + payload.size();
    return {};
}

Result<void> Journal::restart() {
    std::error_code error;
    for (const fs::directory_entry& e : fs::directory_iterator(folder_, error))
        if (e.path().filename() != "journal") fs::remove_all(e.path(), error);
    fs::remove(partialPath(), error);
    entries_.clear();
    const std::array<uint64_t, 2> head{kMagic, identity_};
    if (::ftruncate(lock_, 0) != 0)
        return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(errno)), folder_);
    STIPPLE_TRY(writeFileAt(folder_ + "/journal", 0, head.data(), sizeof(head)));
    end_ = sizeof(head);
    return {};
}

Result<void> Journal::announce(uint64_t bytes, Progress& progress) const {
    progress.say(fmt::format("temporary disk space: up to {} in {}", humanBytes(bytes), folder_));
    struct statvfs disk {};
    if (::statvfs(folder_.c_str(), &disk) != 0) return {};
    const uint64_t room = uint64_t{disk.f_bavail} * disk.f_frsize;
    if (bytes <= room) return {};
    return fail(
        ErrorKind::budget,
        fmt::format("{} of temporary files are needed, but there is room for {}", humanBytes(bytes), humanBytes(room)),
        folder_, "name another folder with --temp, or give more --memory");
}

void Journal::remove() {
    std::error_code error;
    fs::remove_all(folder_, error);
}

}  // namespace stipple::lod
