#include "engine/base/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
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
    if (path.empty()) return fail(ErrorKind::usage, "the name of a file to read is empty", "", "name a file");
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

Result<std::string> readTextFile(const std::string& path, uint64_t sizeLimitBytes) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    if (file.sizeBytes() > sizeLimitBytes)
        return fail(ErrorKind::input,
                    fmt::format("has {} bytes, more than the {} allowed here", file.sizeBytes(), sizeLimitBytes), path);
    std::string text(file.sizeBytes(), '\0');
    STIPPLE_TRY(file.readAt(0, text.data(), text.size()));
    return text;
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

uint64_t InputFile::identity() const { return fileIdentity(path_); }

uint64_t MemorySource::identity() const { return hashBytes(bytes_.data(), bytes_.size()); }

Result<void> MemorySource::readAt(uint64_t offset, void* destination, size_t count) const {
    if (offset > bytes_.size() || count > bytes_.size() - offset)
        return fail(ErrorKind::input,
                    fmt::format("{} bytes are needed at offset {}, but there are {}", count, offset, bytes_.size()),
                    name_);
    if (count > 0) std::memcpy(destination, bytes_.data() + offset, count);
    return {};
}

}  // namespace stipple
