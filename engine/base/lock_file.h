// One file of locks that processes share: each of its bytes stands for something that many may use or one may change.
// What a process held is free again when it ends, however it ends.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "engine/base/result.h"

namespace stipple {

class LockFile {
  public:
    /// Makes the file if it is not there. Two LockFiles of one process are strangers to each other; threads that share
    /// one exclude each other where one holds a place alone.
    static Result<LockFile> open(const std::string& path);
    LockFile(LockFile&& other) noexcept;
    LockFile& operator=(LockFile&&) = delete;
    ~LockFile();

    /// Places are below 2^62.
    /// Together with others who share it. False: somebody holds it alone. (Where the file system has no locks: true.)
    bool tryShare(uint64_t place) const;
    /// Alone. False: somebody else holds it (not where a thread shares it by this very object).
    bool tryTake(uint64_t place) const;
    void release(uint64_t place) const;
    /// By somebody else, shared or alone.
    bool isHeld(uint64_t place) const;

  private:
    /// Places that are held alone: the system excludes other descriptors only.
    struct Alone {
        std::mutex mutex;
        std::set<uint64_t> places;
    };
    explicit LockFile(int descriptor) : descriptor_(descriptor), alone_(std::make_unique<Alone>()) {}
    bool set(uint64_t place, short how) const;
    int descriptor_ = -1;
    std::unique_ptr<Alone> alone_;
};

}  // namespace stipple
