// The folder of stores that were built from raw inputs: KEY.stipple, and beside it KEY.json with what it was made from.
// One file of locks says which are open and which are being built.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/lock_file.h"

namespace stipple::scene {

/// What a store in the cache was made from.
struct CacheRecord {
    std::vector<std::string> inputs;
    std::string part;                ///< which of the stores that they give
    std::vector<std::string> notes;  ///< what the build said
    std::chrono::system_clock::time_point made;
};

struct CacheEntry {
    std::string key, path;
    uint64_t bytes = 0;    ///< with all that belongs to it
    bool isWhole = false;  ///< false: an interrupted build
    bool isInUse = false;  ///< open in some program, or being built
    std::chrono::system_clock::time_point used;
    std::optional<CacheRecord> record;  ///< none: not read, or of an earlier version
};

class CacheFolder {
  public:
    /// $XDG_CACHE_HOME/stipple or ~/.cache/stipple, whether it is there or not.
    static std::string path();
    /// Within it: where the gpu backend keeps what drivers compile. Anything in there may go at any time. Empty where
    /// the folder is not the user's own (a relative one): a driver is given nothing that happens to lie there.
    static std::string pipelinesPath();
    /// Made if it is not there.
    static Result<CacheFolder> open();

    std::string storePath(const std::string& key) const { return path_ + "/" + key + ".stipple"; }
    /// Nobody removes the store while this object lives. An error if it is interrupted.
    Result<void> use(const std::string& key, const std::function<bool()>& isStopped) const;
    /// Waits until nobody else builds that store, here or elsewhere; `waits` is called once, if it has to. An error if
    /// it is interrupted.
    Result<void> lockBuild(const std::string& key, const std::function<void()>& waits,
                           const std::function<bool()>& isStopped) const;
    void unlockBuild(const std::string& key) const;
    void writeRecord(const std::string& key, const CacheRecord& record) const;
    std::optional<CacheRecord> readRecord(const std::string& key) const;
    /// Was used just now.
    void touch(const std::string& key) const;
    /// The store itself; whoever has it open keeps what was open.
    void removeStore(const std::string& key) const;
    void removeRecord(const std::string& key) const;
    /// What interrupted builds of the store left, if it is not a build that runs. False if anything stays.
    bool removeLeftovers(const std::string& key) const;

    /// Most recently used first, without their records.
    std::vector<CacheEntry> entries() const;
    /// All of an entry; false if it is in use or cannot be removed.
    bool remove(const CacheEntry& entry) const;
    /// Removes what was used least recently until the rest has no more than `bytes`. Returns what went.
    std::vector<CacheEntry> shrinkTo(uint64_t bytes) const;

  private:
    CacheFolder(std::string path, LockFile locks) : path_(std::move(path)), locks_(std::move(locks)) {}
    std::vector<std::string> filesOf(const std::string& key) const;
    std::vector<CacheEntry> sizes() const;  ///< entries() that do not say what is in use
    std::string path_;
    LockFile locks_;
};

/// What the cache may hold: `option`, else STIPPLE_CACHE_LIMIT, else 20 GiB or a fifth of the disk, whichever is less.
Result<uint64_t> cacheLimit(const std::string& option);

}  // namespace stipple::scene
