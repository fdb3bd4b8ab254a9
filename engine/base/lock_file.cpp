#include "engine/base/lock_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace stipple {

LockFile::LockFile(LockFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), alone_(std::move(other.alone_)) {}
LockFile::~LockFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

Result<LockFile> LockFile::open(const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0644);
    if (descriptor < 0)
        return fail(ErrorKind::output, fmt::format("cannot be written: {}", std::strerror(errno)), path,
                    "choose a folder that can be written");
    return LockFile(descriptor);
}

namespace {

struct flock lockOf(uint64_t place, short how) {
    struct flock lock {};
    lock.l_type = how;
    lock.l_whence = SEEK_SET;
    lock.l_start = static_cast<off_t>(place & 0x3fffffffffffffffull);
    lock.l_len = 1;
    return lock;
}

}  // namespace

/// Locks of an open file, not of a process (F_OFD_SETLK): another descriptor that is closed does not free them.
bool LockFile::set(uint64_t place, short how) const {
    struct flock wanted = lockOf(place, how);
    int result = 0;
    do result = ::fcntl(descriptor_, F_OFD_SETLK, &wanted);
    while (result != 0 && errno == EINTR);
    return result == 0 || (errno != EAGAIN && errno != EACCES);
}

bool LockFile::tryShare(uint64_t place) const {
    const std::lock_guard lock(alone_->mutex);
    return alone_->places.count(place) == 0 && set(place, F_RDLCK);
}

bool LockFile::tryTake(uint64_t place) const {
    const std::lock_guard lock(alone_->mutex);
    if (alone_->places.count(place) > 0 || !set(place, F_WRLCK)) return false;
    alone_->places.insert(place);
    return true;
}

void LockFile::release(uint64_t place) const {
    const std::lock_guard lock(alone_->mutex);
    alone_->places.erase(place);
    set(place, F_UNLCK);
}

bool LockFile::isHeld(uint64_t place) const {
    struct flock asked = lockOf(place, F_WRLCK);
    return ::fcntl(descriptor_, F_OFD_GETLK, &asked) == 0 && asked.l_type != F_UNLCK;
}

}  // namespace stipple
