// A file that appears whole or not at all.
//
//   create: NAME.partial.PID, locked    append ... append    commit: permissions of the old NAME, rename over it
//
// Only regular files are replaced. The lock says that a temporary file is being written: it goes with its process,
// however that ends, so that what killed processes leave can be told from what others still write (numbers of processes
// are used again).
#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "engine/base/file.h"

namespace stipple {
namespace fs = std::filesystem;
namespace {

const char* nameOfKind(mode_t mode) {
    if (S_ISDIR(mode)) return "is a directory";
    if (S_ISFIFO(mode)) return "is a pipe, not a regular file";
    if (S_ISCHR(mode) || S_ISBLK(mode)) return "is a device, not a regular file";
    return "is not a regular file";
}

tl::unexpected<Error> cannotBeWritten(const std::string& path, int error) {
    return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(error)), path,
                "choose a folder that exists and can be written");
}

/// What to do about a failed write.
std::string adviceFor(int error, const char* left) {
    if (error == ENOSPC) return fmt::format("the disk is full; {}", left);
    if (error == EDQUOT) return fmt::format("the disk quota is used up; {}", left);
    if (error == EFBIG) return fmt::format("it is larger than files may be here, see ulimit -f; {}", left);
    return left;
}

enum class Lock { ours, others, impossible };
Lock lock(int descriptor) {
    if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return Lock::ours;
    return errno == EWOULDBLOCK ? Lock::others : Lock::impossible;  // (some network file systems)
}

/// "<name>.partial.<numbers>"
bool isTemporaryOf(const std::string& name, const std::string& entry) {
    const std::string prefix = name + ".partial.";
    return entry.size() > prefix.size() && entry.compare(0, prefix.size(), prefix) == 0 &&
           entry.find_first_not_of("0123456789.", prefix.size()) == std::string::npos;
}

/// Is that still the file of that name? (It may be gone since it was opened, and another have its name.)
bool isNamed(const std::string& path, const struct stat& file) {
    struct stat named {};
    return ::lstat(path.c_str(), &named) == 0 && named.st_dev == file.st_dev && named.st_ino == file.st_ino;
}

/// Removes temporary files of `target` that nobody writes any more.
void removeLeftovers(const std::string& target) {
    const fs::path path(target);
    const std::string folder = path.has_parent_path() ? path.parent_path().string() : ".";
    const std::string name = path.filename().string();
    DIR* const listing = ::opendir(folder.c_str());
    if (listing == nullptr) return;
    while (const dirent* entry = ::readdir(listing)) {
        if (!isTemporaryOf(name, entry->d_name)) continue;
        const std::string left = folder + "/" + entry->d_name;
        const int descriptor = ::open(left.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
        if (descriptor < 0) continue;
        struct stat info {};
        if (::fstat(descriptor, &info) == 0 && S_ISREG(info.st_mode) && lock(descriptor) == Lock::ours &&
            isNamed(left, info))
            ::unlink(left.c_str());
        ::close(descriptor);
    }
    ::closedir(listing);
}

/// A new file, locked; -1 and errno if it cannot be made. One that is there already is another's.
int createLocked(const std::string& path) {
    for (;;) {
        const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
        if (descriptor < 0) return -1;
        // (Between the two calls it looks like a left-over, and may be gone.)
        struct stat info {};
        const Lock got = lock(descriptor);
        if (got == Lock::impossible) return descriptor;
        if (got == Lock::ours && ::fstat(descriptor, &info) == 0 && info.st_nlink > 0) return descriptor;
        ::close(descriptor);
    }
}

/// 0 or an error number.
int writeAll(int descriptor, uint64_t offset, const void* bytes, size_t count) {
    const auto* in = static_cast<const char*>(bytes);
    while (count > 0) {
        const ssize_t put = ::pwrite(descriptor, in, count, static_cast<off_t>(offset));
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) return put < 0 ? errno : ENOSPC;
        in += put;
        offset += static_cast<uint64_t>(put);
        count -= static_cast<size_t>(put);
    }
    return 0;
}

/// Owner and permissions as far as that is allowed; whether all of it could be kept does not matter.
void keepPermissions(int descriptor, const struct stat& of) {
    if (::fchown(descriptor, of.st_uid, of.st_gid) != 0 &&
        ::fchown(descriptor, static_cast<uid_t>(-1), of.st_gid) != 0) {
        // Another group must not get what the old one had.
        ::fchmod(descriptor, of.st_mode & 0707u);
        return;
    }
    ::fchmod(descriptor, of.st_mode & 0777u);
}

}  // namespace

Result<std::string> outputTarget(const std::string& path) {
    if (path.empty()) return fail(ErrorKind::usage, "the name of the file to write is empty", "", "name a file");
    if (path.back() == '/') return fail(ErrorKind::usage, "names a folder", path, "name a file to write");
    struct stat info {};
    if (::lstat(path.c_str(), &info) != 0) return path;
    std::string target = path;
    if (S_ISLNK(info.st_mode)) {
        std::error_code error;
        if (::stat(path.c_str(), &info) != 0)
            return fail(ErrorKind::output,
                        errno == ELOOP ? std::string("is a link that leads to itself")
                                       : fmt::format("is a link to {}, which is not there",
                                                     fs::read_symlink(path, error).string()),
                        path, "remove the link, or name another file");
        target = fs::canonical(path, error).string();
        if (error)
            return fail(ErrorKind::output, "is a link that cannot be followed: " + error.message(), path,
                        "name another file");
    }
    if (!S_ISREG(info.st_mode)) return fail(ErrorKind::output, nameOfKind(info.st_mode), path, "name a file to write");
    if (::access(target.c_str(), W_OK) != 0)
        return fail(ErrorKind::output, fmt::format("must not be written over: {}", std::strerror(errno)), path,
                    "name another file, or change its permissions");
    return target;
}

OutputFile::OutputFile(int descriptor, std::string path, std::string target, std::string temporaryPath)
    : descriptor_(descriptor),
      path_(std::move(path)),
      target_(std::move(target)),
      temporaryPath_(std::move(temporaryPath)) {}
OutputFile::OutputFile(OutputFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      position_(other.position_),
      path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      temporaryPath_(std::move(other.temporaryPath_)),
      isKept_(other.isKept_) {}
OutputFile::~OutputFile() {
    if (descriptor_ < 0) return;
    if (!isKept_) ::unlink(temporaryPath_.c_str());
    ::close(descriptor_);
}

Result<OutputFile> OutputFile::create(const std::string& path) {
    STIPPLE_ASSIGN(std::string target, outputTarget(path));
    removeLeftovers(target);
    constexpr int kMostAtOnce = 100;  // by this process, or by others that have its number in their containers
    std::string temporary = fmt::format("{}.partial.{}", target, ::getpid());
    int descriptor = createLocked(temporary);
    for (int next = 1; descriptor < 0 && errno == EEXIST && next < kMostAtOnce; ++next) {
        temporary = fmt::format("{}.partial.{}.{}", target, ::getpid(), next);
        descriptor = createLocked(temporary);
    }
    if (descriptor < 0) return cannotBeWritten(path, errno);
    return OutputFile(descriptor, path, std::move(target), std::move(temporary));
}

Result<OutputFile> OutputFile::resume(const std::string& path, const std::string& temporaryPath, uint64_t bytes) {
    STIPPLE_ASSIGN(std::string target, outputTarget(path));
    const int descriptor = ::open(temporaryPath.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
    if (descriptor < 0) return cannotBeWritten(path, errno);
    OutputFile file(descriptor, path, std::move(target), temporaryPath);
    file.position_ = bytes;
    file.isKept_ = true;
    struct stat info {};
    if (::fstat(descriptor, &info) != 0) return cannotBeWritten(path, errno);
    if (!S_ISREG(info.st_mode))
        return fail(ErrorKind::output, nameOfKind(info.st_mode), temporaryPath, "remove it, or name another output");
    Lock got = lock(descriptor);  // a process that was just killed may take a moment to be gone
    for (int attempt = 0; attempt < 30 && got == Lock::others; ++attempt) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        got = lock(descriptor);
    }
    if (got == Lock::others)
        return fail(ErrorKind::output, "is being written by another process", temporaryPath,
                    "wait for it, or name another output");
    if (::ftruncate(descriptor, static_cast<off_t>(bytes)) != 0) return cannotBeWritten(path, errno);
    return file;
}

Result<void> OutputFile::writeAt(uint64_t offset, const void* bytes, size_t count) {
    const int error = writeAll(descriptor_, offset, bytes, count);
    if (error == 0) return {};
    return fail(
        ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(error)), path_,
        adviceFor(error, isKept_ ? "what is done stays: run the same command to go on" : "nothing was left behind"));
}

Result<void> writeFileAt(const std::string& path, uint64_t offset, const void* bytes, size_t count) {
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    const int error = descriptor < 0 ? errno : writeAll(descriptor, offset, bytes, count);
    if (descriptor >= 0) ::close(descriptor);
    if (error == 0) return {};
    const bool isFull = error == ENOSPC || error == EDQUOT || error == EFBIG;
    return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(error)), path,
                isFull ? adviceFor(error, "make room or name another folder with --temp")
                       : "choose a folder that can be written");
}

Result<void> OutputFile::append(const void* bytes, size_t count) {
    STIPPLE_TRY(writeAt(position_, bytes, count));
    position_ += count;
    return {};
}

Result<void> OutputFile::flush() {
    if (::fdatasync(descriptor_) == 0) return {};
    return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(errno)), path_,
                adviceFor(errno, "nothing was left behind"));
}

Result<void> OutputFile::commit() {
    STIPPLE_ASSIGN(const std::string target, outputTarget(target_));  // (what is there may be new)
    if (target != target_) return fail(ErrorKind::output, "became a link while it was written", path_, "try again");
    struct stat old {};
    if (::stat(target_.c_str(), &old) == 0) {
        keepPermissions(descriptor_, old);
        STIPPLE_TRY(flush());  // what was good until now is gone only when this is on the disk
    }
    // Some file systems say only when a file is closed that it could not be written; the lock stays.
    const int copy = ::dup(descriptor_);
    if (copy >= 0 && ::close(copy) != 0)
        return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(errno)), path_,
                    adviceFor(errno, "nothing was left behind"));
    if (::rename(temporaryPath_.c_str(), target_.c_str()) != 0)
        return fail(ErrorKind::output, fmt::format("cannot be renamed into place: {}", std::strerror(errno)), path_);
    ::close(std::exchange(descriptor_, -1));
    return {};
}

Result<void> writeWholeFile(const std::string& path, const void* bytes, size_t count) {
    STIPPLE_ASSIGN(OutputFile file, OutputFile::create(path));
    STIPPLE_TRY(file.append(bytes, count));
    return file.commit();
}

}  // namespace stipple
