// Chunks on their way to the device: their bytes lie one after another in memory that both see, written as they come,
// and the next frame copies them to their places.
#pragma once

#include <vector>

#include "engine/gpu/device.h"
#include "lod/store/chunk.h"

namespace stipple::gpu {

class Staging {
  public:
    explicit Staging(const Device& device) : device_(&device) {}

    /// Writes all of a chunk that backends draw from, to be copied to `offset` of `page`. Error: no memory for it.
    Result<void> add(const lod::Chunk& chunk, VkBuffer page, uint64_t offset);
    /// What was to be copied there is not wanted any more. Was there anything?
    bool drop(VkBuffer page, uint64_t offset);
    bool isEmpty() const { return copies_.empty(); }
    void recordCopies(VkCommandBuffer commands) const;
    /// The device has copied it all; the memory stays, if it is not much.
    void clear();

  private:
    struct Copy {
        VkBuffer page;
        VkBufferCopy region;
    };
    Result<void> ensure(uint64_t bytes);
    const Device* device_;
    Buffer buffer_;
    uint64_t used_ = 0;
    std::vector<Copy> copies_;
};

}  // namespace stipple::gpu
