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
    void release(const Place& place);
    VkBuffer buffer(const Place& p) const { return pages_[p.page].buffer.handle(); }
    VkDeviceAddress address(const Place& p) const { return pages_[p.page].buffer.address() + p.offset; }

  private:
    struct Page {
        Buffer buffer;
        RangeAllocator ranges;
    };
    const Device& device_;
    std::vector<Page> pages_;
};

}  // namespace stipple::gpu
