// A command buffer of a test's own: recorded, run once, waited for.
#pragma once

#include <gtest/gtest.h>

#include <cstring>

#include "engine/gpu/gpu_backend.h"

namespace stipple::gpu {

class OneTimeCommands {
  public:
    /// Recording begins.
    explicit OneTimeCommands(const Device& device) : device_(device) {
        VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
        poolInfo.queueFamilyIndex = device.queueFamily;
        EXPECT_EQ(vkCreateCommandPool(device.device, &poolInfo, nullptr, &pool_), VK_SUCCESS);
        VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
        allocate.commandPool = pool_;
        allocate.commandBufferCount = 1;
        EXPECT_EQ(vkAllocateCommandBuffers(device.device, &allocate, &commands_), VK_SUCCESS);
        const VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
        EXPECT_EQ(vkBeginCommandBuffer(commands_, &begin), VK_SUCCESS);
    }
    ~OneTimeCommands() { vkDestroyCommandPool(device_.device, pool_, nullptr); }
    OneTimeCommands(const OneTimeCommands&) = delete;
    OneTimeCommands& operator=(const OneTimeCommands&) = delete;

    VkCommandBuffer handle() const { return commands_; }
    void end() { EXPECT_EQ(vkEndCommandBuffer(commands_), VK_SUCCESS); }
    /// Ends recording; has run when it returns, and the host sees what was written. It waits for `after`.
    void run(const SemaphoreValue& after = {}) {
        VkMemoryBarrier2 written{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
        written.srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
        written.srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT;
        written.dstStageMask = VK_PIPELINE_STAGE_2_HOST_BIT;
        written.dstAccessMask = VK_ACCESS_2_HOST_READ_BIT;
        recordBarriers(commands_, {}, &written);
        end();
        EXPECT_TRUE(submitCommands(device_.queue, commands_, after, {}, VK_NULL_HANDLE));
        EXPECT_EQ(vkDeviceWaitIdle(device_.device), VK_SUCCESS);
    }

  private:
    const Device& device_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

/// What compute shaders have counted, to the host.
inline void copyCounts(const DeviceCounts& from, void* to, size_t bytes) {
    auto host = Buffer::create(*from.device, bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::host, "copy");
    ASSERT_TRUE(host);
    OneTimeCommands commands(*from.device);
    const auto counted =
        bufferBarrier(from.counts, {VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT},
                      {VK_PIPELINE_STAGE_2_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_READ_BIT});
    recordBarriers(commands.handle(), {&counted, 1});
    const VkBufferCopy region{0, 0, bytes};
    vkCmdCopyBuffer(commands.handle(), from.counts, host->handle(), 1, &region);
    commands.run();
    std::memcpy(to, host->mapped(), bytes);
}

}  // namespace stipple::gpu
