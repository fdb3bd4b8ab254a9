#include "engine/base/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "engine/base/hash.h"

namespace stipple {

InputFile::InputFile(int descriptor, uint64_t sizeBytes, std::string path)
    : descriptor_(descriptor), sizeBytes_(sizeBytes), path_(std::move(path)) {}
InputFile::InputFile(InputFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), sizeBytes_(other.sizeBytes_), path_(std::move(other.path_)) {}
InputFile& InputFile::operator=(InputFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    std::swap(sizeBytes_, other.sizeBytes_);
    std::swap(path_, other.path_);
    return *this;
}
InputFile::~InputFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

Result<InputFile> InputFile::open(const std::string& path) {
    // Opening a FIFO that nobody writes to would wait for ever.
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (descriptor < 0) return fail(ErrorKind::input, std::strerror(errno), path, "check the path and its permissions");
    struct stat info {};
    if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode)) {
        ::close(descriptor);
        return fail(ErrorKind::input, S_ISDIR(info.st_mode) ? "is a directory" : "is not a regular file", path,
                    "name a file");
    }
    return InputFile(descriptor, static_cast<uint64_t>(info.st_size), path);
}

Result<void> InputFile::readAt(uint64_t offset, void* destination, size_t count) const {
    if (offset > sizeBytes_ || count > sizeBytes_ - offset)
        return fail(
            ErrorKind::input,
            fmt::format("{} bytes are needed at offset {}, but the file has {} bytes", count, offset, sizeBytes_),
            path_, "the file is truncated");
    auto* out = static_cast<char*>(destination);
    while (count > 0) {
        const ssize_t got = ::pread(descriptor_, out, count, static_cast<off_t>(offset));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0)
            return fail(ErrorKind::input, got < 0 ? std::strerror(errno) : "the file became shorter while it was read",
                        path_);
        out += got;
        offset += static_cast<uint64_t>(got);
        count -= static_cast<size_t>(got);
    }
    return {};
}

OutputFile::OutputFile(int descriptor, std::string path, std::string temporaryPath)
    : descriptor_(descriptor), path_(std::move(path)), temporaryPath_(std::move(temporaryPath)) {}
OutputFile::OutputFile(OutputFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      position_(other.position_),
      path_(std::move(other.path_)),
      temporaryPath_(std::move(other.temporaryPath_)),
      isKept_(other.isKept_) {}
OutputFile::~OutputFile() {
    if (descriptor_ < 0) return;
    ::close(descriptor_);
    if (!isKept_) ::unlink(temporaryPath_.c_str());
}

Result<OutputFile> OutputFile::create(const std::string& path) {
    struct stat info {};
    if (::stat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode))
        return fail(ErrorKind::output, "is a directory", path, "name a file to write");
    std::string temporary = fmt::format("{}.partial.{}", path, ::getpid());
    const int descriptor = ::open(temporary.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (descriptor < 0)
        return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(errno)), path,
                    "choose a folder that exists and can be written");
    return OutputFile(descriptor, path, std::move(temporary));
}

Result<OutputFile> OutputFile::resume(const std::string& path, const std::string& temporaryPath, uint64_t bytes) {
    const int descriptor = ::open(temporaryPath.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (descriptor < 0 || ::ftruncate(descriptor, static_cast<off_t>(bytes)) != 0) {
        const std::string why = std::strerror(errno);
        if (descriptor >= 0) ::close(descriptor);
        return fail(ErrorKind::output, "cannot be written: " + why, path,
                    "choose a folder that exists and can be written");
    }
    OutputFile file(descriptor, path, temporaryPath);
    file.position_ = bytes;
    file.isKept_ = true;
    return file;
}

namespace {

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

}  // namespace

Result<void> OutputFile::writeAt(uint64_t offset, const void* bytes, size_t count) {
    const int error = writeAll(descriptor_, offset, bytes, count);
    if (error == 0) return {};
    const char* const left = isKept_ ? "what is done stays: run the same command to go on" : "nothing was left behind";
    return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(error)), path_,
                error == ENOSPC ? fmt::format("the disk is full; {}", left) : left);
}

Result<void> writeFileAt(const std::string& path, uint64_t offset, const void* bytes, size_t count) {
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    const int error = descriptor < 0 ? errno : writeAll(descriptor, offset, bytes, count);
    if (descriptor >= 0) ::close(descriptor);
    if (error == 0) return {};
    return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(error)), path,
                error == ENOSPC ? "the disk is full; make room or name another folder with --temp"
                                : "choose a folder that can be written");
}

Result<void> OutputFile::append(const void* bytes, size_t count) {
    STIPPLE_TRY(writeAt(position_, bytes, count));
    position_ += count;
    return {};
}

Result<void> OutputFile::flush() {
    if (::fdatasync(descriptor_) != 0)
        return fail(ErrorKind::output, std::strerror(errno), path_, "nothing was left behind");
    return {};
}

Result<void> OutputFile::commit() {
    if (::rename(temporaryPath_.c_str(), path_.c_str()) != 0)
        return fail(ErrorKind::output, fmt::format("cannot be renamed into place: {}", std::strerror(errno)), path_);
    ::close(std::exchange(descriptor_, -1));
    return {};
}

Result<std::string> readTextFile(const std::string& path, uint64_t sizeLimitBytes) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    if (file.sizeBytes() > sizeLimitBytes)
        return fail(ErrorKind::input,
                    fmt::format("has {} bytes, more than the {} allowed here", file.sizeBytes(), sizeLimitBytes), path);
    std::string text(file.sizeBytes(), '\0');
    STIPPLE_TRY(file.readAt(0, text.data(), text.size()));
    return text;
}

Result<void> writeWholeFile(const std::string& path, const void* bytes, size_t count) {
    STIPPLE_ASSIGN(OutputFile file, OutputFile::create(path));
    STIPPLE_TRY(file.append(bytes, count));
    return file.commit();
}

Result<std::vector<uint8_t>> readWhole(const std::string& path) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    std::vector<uint8_t> bytes(file.sizeBytes());
    if (!bytes.empty()) STIPPLE_TRY(file.readAt(0, bytes.data(), bytes.size()));
    return bytes;
}

uint64_t fileIdentity(const std::string& path) {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) return 0;
    const std::string text = fmt::format("{}|{}|{}|{}", path, info.st_size, info.st_mtim.tv_sec, info.st_mtim.tv_nsec);
    return hashBytes(text.data(), text.size());
}

}  // namespace stipple
