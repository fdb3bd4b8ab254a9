// Streamed records live in a few large buffers. Ranges are first-fit; a chunk never straddles pages.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/gpu/device.h"

namespace stipple::gpu {

/// Free ranges of one page; pure bookkeeping, tested without a GPU. Once warm it takes no memory of its own.
class RangeAllocator {
  public:
    explicit RangeAllocator(uint64_t bytes) : free_{{0, bytes}} {}
    /// Offset of a free range of `bytes`, or ~0.
    uint64_t allocate(uint64_t bytes);
    void release(uint64_t offset, uint64_t bytes);
    uint64_t freeBytes() const;
    size_t freeRanges() const { return free_.size(); }

  private:
    struct Range {
        uint64_t offset, bytes;
    };
    std::vector<Range> free_;  ///< by offset, never adjacent
};

class PageStore {
  public:
    struct Place {
        uint32_t page = 0;
        uint64_t offset = 0, bytes = 0;
    };
    explicit PageStore(const Device& device) : device_(device) {}
    Result<Place> allocate(uint64_t bytes);
    /// Of what no frame reads.
    void free(const Place& place) { pages_[place.page].ranges.release(place.offset, place.bytes); }
    /// Not to be written again before frame `lastReader` is done: `reclaim` tells. Never of an earlier one than before.
    void release(const Place& place, uint64_t lastReader);
    /// All frames up to this one are done.
    void reclaim(uint64_t lastDone);
    bool hasReleased() const { return !released_.empty(); }
    VkBuffer buffer(const Place& p) const { return pages_[p.page].buffer.handle(); }
    VkDeviceAddress address(const Place& p) const { return pages_[p.page].buffer.address() + p.offset; }

  private:
    struct Page {
        Buffer buffer;
        RangeAllocator ranges;
    };
    struct Released {
        Place place;
        uint64_t lastReader;
    };
    const Device& device_;
    std::vector<Page> pages_;
    std::vector<Released> released_;  ///< still read, perhaps
};

}  // namespace stipple::gpu
