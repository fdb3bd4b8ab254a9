// Records passes in order. From the buffers that each pass says it reads and writes follow the barriers, a debug label
// and two timestamps; nothing is scheduled or reordered.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "engine/gpu/device.h"

namespace stipple::gpu {

struct BufferUse {
    VkBuffer buffer;
    bool writes;
    bool isIndirect = false;  ///< numbers of groups are read from it, and nothing else
};

class PassList {
  public:
    static constexpr uint32_t kMaxPasses = 64;
    PassList(const Device& device, VkCommandBuffer commands, VkQueryPool queries)
        : device_(device), commands_(commands), queries_(queries) {}
    /// Of a buffer that a frame before may still be copied from.
    void wasCopied(VkBuffer buffer);
    /// `isTransfer`: fills and copies instead of a dispatch.
    void begin(const std::string& name, const std::vector<BufferUse>& uses, bool isTransfer);
    void end();
    /// Makes a buffer's contents visible to the host after the fence.
    void toHost(VkBuffer buffer);
    const std::vector<std::string>& names() const { return names_; }

  private:
    void stamp(uint32_t query);
    /// The last write of a buffer, if there was one, and what has read it since: to those it is visible.
    struct Last {
        BufferTouch write{VK_PIPELINE_STAGE_2_NONE, VK_ACCESS_2_NONE},
            reads{VK_PIPELINE_STAGE_2_NONE, VK_ACCESS_2_NONE};
    };
    const Device& device_;
    VkCommandBuffer commands_;
    VkQueryPool queries_;
    std::map<VkBuffer, Last> last_;
    std::vector<std::string> names_;
};

}  // namespace stipple::gpu
