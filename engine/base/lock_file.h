// One file of locks that processes share: each of its bytes stands for something that many may use or one may change.
// What a process held is free again when it ends, however it ends.
#pragma once

#include <cstdint>
#include <string>

#include "engine/base/result.h"

namespace stipple {

class LockFile {
  public:
    /// Makes the file if it is not there. Two LockFiles of one process are strangers to each other.
    static Result<LockFile> open(const std::string& path);
    LockFile(LockFile&& other) noexcept;
    LockFile& operator=(LockFile&&) = delete;
    ~LockFile();

    /// Places are below 2^62.
    /// Together with others who share it. False: somebody holds it alone. (Where the file system has no locks: true.)
    bool tryShare(uint64_t place) const;
    /// Alone. False: somebody else holds it.
    bool tryTake(uint64_t place) const;
    void release(uint64_t place) const;
    /// By somebody else, shared or alone.
    bool isHeld(uint64_t place) const;

  private:
    explicit LockFile(int descriptor) : descriptor_(descriptor) {}
    bool set(uint64_t place, short how) const;
    int descriptor_ = -1;
};

}  // namespace stipple
