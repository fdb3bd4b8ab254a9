// Bytes that several threads append to: in memory, in a place in memory that is large enough, or in a file.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "engine/base/huge_region.h"
#include "engine/base/result.h"

namespace stipple {

class Spill {
  public:
    /// `path` empty: in memory. A file that is there already stays what it is (see restore).
    explicit Spill(std::string path) : path_(std::move(path)) {}
    /// In memory: in that part of a region, which outlives this and is large enough for all. Before anything is
    /// appended.
    void placeIn(HugeRegion& region, size_t part) {
        region_ = &region;
        part_ = part;
    }
    /// From several threads; what one call brings stays together. What a region has no room for is an error without a
    /// name: whoever appends knows of what.
    Result<void> append(std::span<const uint8_t> bytes);

    const std::string& path() const { return path_; }
    /// So far.
    uint64_t bytes() const { return bytes_; }

    // When no thread appends any more:
    /// Everything. In memory it is gone afterwards.
    Result<std::vector<uint8_t>> take();
    /// Everything, where it lies; what is in a file or a vector moves to `held`.
    Result<std::span<const uint8_t>> look(std::vector<uint8_t>& held);
    /// What lies in a region goes. (The rest went to whom it was handed.)
    void release();
    /// A part of it; nothing goes.
    Result<std::vector<uint8_t>> part(uint64_t offset, uint64_t count) const;
    /// Hashes what came since the last time, for take() to check, if it is a file. More may be appended.
    Result<void> seal();
    struct Segment {
        uint64_t bytes = 0, hash = 0;
    };
    const std::vector<Segment>& segments() const { return segments_; }
    /// A file that an earlier process filled and sealed; what lies behind that does not count.
    void restore(std::vector<Segment> segments);
    /// Deletes the file.
    void remove();

  private:
    std::string path_;
    std::mutex mutex_;
    std::vector<uint8_t> memory_;
    HugeRegion* region_ = nullptr;
    size_t part_ = 0;
    std::atomic<uint64_t> bytes_{0};
    std::vector<Segment> segments_;
    uint64_t sealedBytes_ = 0;
};

}  // namespace stipple
