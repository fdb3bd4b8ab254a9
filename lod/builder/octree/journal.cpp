#include "lod/builder/octree/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "engine/base/hash.h"
#include "lod/store/file_kind.h"

namespace stipple::lod {
namespace fs = std::filesystem;
namespace {

constexpr uint64_t kHeadBytes = 16;
constexpr uint64_t kMagic = 0x32444c4942505453ull;  // "STPBILD2"
constexpr uint64_t kAnyVersion = ~uint64_t{0} >> 8;

struct EntryHead {
    uint64_t bytes = 0, hash = 0;
    Journal::What what{};
    uint32_t unused = 0;
};

bool holdsMore(const std::string& folder) {
    std::error_code error;
    for (const fs::directory_entry& e : fs::directory_iterator(folder, error))
        if (e.path().filename() != "journal") return true;
    return false;
}

/// All but the journal.
void clear(const std::string& folder) {
    std::error_code error;
    for (const fs::directory_entry& e : fs::directory_iterator(folder, error))
        if (e.path().filename() != "journal") fs::remove_all(e.path(), error);
}

/// On disk, by all files below.
uint64_t allocatedBytes(const std::string& folder) {
    uint64_t sum = 0;
    std::error_code error;
    for (auto it = fs::recursive_directory_iterator(folder, error); !error && it != fs::recursive_directory_iterator();
         it.increment(error)) {
        struct stat info {};
        if (::lstat(it->path().c_str(), &info) == 0) sum += static_cast<uint64_t>(info.st_blocks) * 512;
    }
    return sum;
}

/// What lies where the store is going to grow: was it left by a build? (Its head is written last.)
bool isOfABuild(const std::string& path) {
    struct stat info {};
    if (::lstat(path.c_str(), &info) != 0 || (S_ISREG(info.st_mode) && info.st_size == 0)) return true;
    if (!S_ISREG(info.st_mode)) return false;
    uint64_t begin = 1;
    const auto file = InputFile::open(path);
    const bool isHeadless = file && file->readAt(0, &begin, std::min<uint64_t>(sizeof(begin), file->sizeBytes()));
    return (isHeadless && begin == 0) || fileKindOf(path) == FileKind::store;
}

/// Is that open file (-1: none) still the one of that name?
bool isNamed(int descriptor, const std::string& path) {
    struct stat own {};
    struct stat named {};
    return descriptor >= 0 && ::fstat(descriptor, &own) == 0 && own.st_nlink > 0 &&
           ::lstat(path.c_str(), &named) == 0 && own.st_dev == named.st_dev && own.st_ino == named.st_ino;
}

}  // namespace

Journal::Journal(Journal&& other) noexcept
    : folder_(std::move(other.folder_)),
      output_(std::move(other.output_)),
      identity_(other.identity_),
      end_(other.end_),
      lock_(std::exchange(other.lock_, -1)),
      isOwn_(other.isOwn_),
      entries_(std::move(other.entries_)) {}
Journal::~Journal() {
    if (lock_ < 0) return;
    if (isOwn_ && end_ <= kHeadBytes) remove();  // nothing to go on with
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

Result<void> Journal::openFile() {
    if (lock_ >= 0) ::close(std::exchange(lock_, -1));
    std::error_code error;
    fs::create_directories(folder_, error);
    const std::string path = folder_ + "/journal";
    const int flags = O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
    // (Somebody's own folder may have that name.)
    const bool isNew = !error && !fs::exists(path, error);
    if (isNew && holdsMore(folder_) && !fs::exists(path, error)) return tl::unexpected(foreign());
    lock_ = error ? -1 : ::open(path.c_str(), flags, 0666);
    if (!error && lock_ < 0 && errno == ENOENT) return {};  // another build ends, and its folder went just now
    if (lock_ < 0)
        return fail(ErrorKind::output,
                    fmt::format("cannot be written: {}", error ? error.message() : std::strerror(errno)), folder_,
                    "name a folder for temporary files with --temp");
    struct stat info {};
    if (::fstat(lock_, &info) != 0 || !S_ISREG(info.st_mode)) return tl::unexpected(foreign());
    return {};
}

Result<void> Journal::take() {
    const std::string path = folder_ + "/journal";
    for (int attempt = 0; attempt < 30; ++attempt) {  // a build that was just killed may take a moment to be gone
        if (attempt > 0) std::this_thread::sleep_for(std::chrono::milliseconds(100));
        // A build that ends removes its folder, also while others wait for it.
        if (!isNamed(lock_, path)) STIPPLE_TRY(openFile());
        if (lock_ >= 0 && ::flock(lock_, LOCK_EX | LOCK_NB) == 0 && isNamed(lock_, path)) return {};
    }
    return fail(ErrorKind::output, "is in use by another build", folder_, "wait for it, or build to another file");
}

Error Journal::foreign() const {
    return {ErrorKind::output, "holds files that are not of a build", folder_, "name another folder with --temp"};
}

Result<Journal> Journal::open(const std::string& folder, const std::string& output, uint64_t identity,
                              Leftovers leftovers) {
    Journal j;
    j.folder_ = folder;
    j.identity_ = identity;
    STIPPLE_ASSIGN(j.output_, outputTarget(output));
    STIPPLE_TRY(j.take());
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(folder + "/journal"));
    std::array<uint64_t, 2> head{};
    const bool hasHead = file.sizeBytes() >= sizeof(head);
    if (hasHead) STIPPLE_TRY(file.readAt(0, head.data(), sizeof(head)));
    if (hasHead ? ((head[0] ^ kMagic) & kAnyVersion) != 0 : holdsMore(folder)) return tl::unexpected(j.foreign());
    const bool isOfOtherProgram = hasHead && head[0] != kMagic && file.sizeBytes() > sizeof(head);
    if (!hasHead || leftovers == Leftovers::replace) {
        STIPPLE_TRY(j.restart());
        return j;
    }
    STIPPLE_TRY(j.readEntries(file));
    if (isOfOtherProgram || (head[1] != identity && !j.entries_.empty())) {
        if (leftovers == Leftovers::goOn)
            return fail(ErrorKind::input,
                        "holds an interrupted build of other input (or it changed since) or with other settings",
                        folder, "finish it with the same command as before, or give --restart to begin anew");
        j.entries_.clear();
    }
    // Killed after the store was complete and before this folder was gone: there is nothing to go on with.
    std::error_code error;
    const bool isOver =
        !j.entries_.empty() && j.entries_.back().what == What::done && !fs::exists(j.partialPath(), error);
    j.isOwn_ = true;
    if (j.entries_.empty() || isOver) STIPPLE_TRY(j.restart());
    return j;
}

Result<void> Journal::readEntries(const InputFile& file) {
    end_ = kHeadBytes;
    for (EntryHead entry{}; end_ + sizeof(entry) <= file.sizeBytes();) {
        STIPPLE_TRY(file.readAt(end_, &entry, sizeof(entry)));
        if (entry.bytes > file.sizeBytes() - end_ - sizeof(entry)) break;
        std::vector<uint8_t> payload(entry.bytes);
        STIPPLE_TRY(file.readAt(end_ + sizeof(entry), payload.data(), payload.size()));
        if (hashBytes(payload.data(), payload.size()) != entry.hash) break;
        entries_.push_back({entry.what, std::move(payload)});
        end_ += sizeof(entry) + entry.bytes;
    }
    return {};
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
    if (!isOfABuild(partialPath()))
        return fail(ErrorKind::output, "is in the way: a build writes there, and it is not of one", partialPath(),
                    "remove or rename it, or name another output");
    clear(folder_);
    isOwn_ = true;
    std::error_code error;
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
    // What an interrupted build left is part of what is needed.
    const uint64_t room = uint64_t{disk.f_bavail} * disk.f_frsize, own = allocatedBytes(folder_);
    if (bytes <= room + own) return {};
    return fail(ErrorKind::budget,
                fmt::format("{} of temporary files are needed, but there is room for {}", humanBytes(bytes),
                            humanBytes(room + own)),
                folder_, "name another folder with --temp, or give more --memory");
}

void Journal::remove() {
    clear(folder_);  // the journal last: without it what is left would be nobody's
    std::error_code error;
    fs::remove(folder_ + "/journal", error);
    fs::remove(folder_, error);  // not what a build that waited has begun there since
}

}  // namespace stipple::lod
