#include "engine/gpu/upload.h"

#include <array>

namespace stipple::gpu {

Result<std::unique_ptr<Copies>> Copies::create(const Device& device) {
    std::unique_ptr<Copies> copies(new Copies(device));
    VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
    type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    VkSemaphoreCreateInfo semaphore{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO};
    semaphore.pNext = &type;
    if (const VkResult r = vkCreateSemaphore(device.device, &semaphore, nullptr, &copies->semaphore_); r != VK_SUCCESS)
        return vulkanError(r, "no semaphore");
    return copies;
}

Copies::~Copies() { vkDestroySemaphore(device_.device, semaphore_, nullptr); }

Result<void> Copies::waitFor(uint64_t value) const {
    VkSemaphoreWaitInfo wait{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO};
    wait.semaphoreCount = 1;
    wait.pSemaphores = &semaphore_;
    wait.pValues = &value;
    if (const VkResult r = vkWaitSemaphores(device_.device, &wait, ~uint64_t{0}); r != VK_SUCCESS)
        return vulkanError(r, "the device was lost");
    return {};
}

Result<std::unique_ptr<Upload>> Upload::create(const Device& device, Copies& copies) {
    std::unique_ptr<Upload> upload(new Upload(device, copies));
    STIPPLE_ASSIGN(upload->pool_, makeCommandPool(device, device.copyFamily));
    STIPPLE_ASSIGN(upload->commands_, makeCommands(device, upload->pool_));
    if (device.copiesTellTimes) {
        STIPPLE_ASSIGN(upload->queries_, makeTimestamps(device, 2));
    }
    return upload;
}

Upload::~Upload() {
    if (last_ > 0) (void)copies_.waitFor(last_);
    vkDestroyQueryPool(device_.device, queries_, nullptr);
    vkDestroyCommandPool(device_.device, pool_, nullptr);
}

Result<void> Upload::record(const Staging& staging) {
    VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    if (const VkResult r = vkBeginCommandBuffer(commands_, &info); r != VK_SUCCESS)
        return vulkanError(r, "cannot record");
    if (queries_ != VK_NULL_HANDLE) {
        vkResetQueryPool(device_.device, queries_, 0, 2);
        vkCmdWriteTimestamp2(commands_, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries_, 0);
    }
    // Chunks that are gone were copied to the same places once.
    VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
    memory.srcStageMask = memory.dstStageMask = VK_PIPELINE_STAGE_2_TRANSFER_BIT;
    memory.srcAccessMask = memory.dstAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
    recordBarriers(commands_, {}, &memory);
    staging.recordCopies(commands_);
    if (queries_ != VK_NULL_HANDLE) vkCmdWriteTimestamp2(commands_, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries_, 1);
    if (const VkResult r = vkEndCommandBuffer(commands_); r != VK_SUCCESS)
        return vulkanError(r, "cannot end recording");
    return {};
}

Result<void> Upload::submit(Staging& staging) {
    if (last_ > 0) STIPPLE_TRY(copies_.waitFor(last_));  // (Long done, unless the frame that it was for failed.)
    staging_.clear();
    isOfLastCall_ = false;
    if (staging.isEmpty()) return {};
    STIPPLE_TRY(record(staging));
    STIPPLE_TRY(submitCommands(device_.copyQueue, commands_, {}, copies_.next(), VK_NULL_HANDLE));
    copies_.count();
    last_ = copies_.sent().value;
    std::swap(staging, staging_);
    isOfLastCall_ = true;
    return {};
}

std::optional<double> Upload::milliseconds() const {
    std::array<uint64_t, 2> stamps{};
    if (!isOfLastCall_ || queries_ == VK_NULL_HANDLE ||
        vkGetQueryPoolResults(device_.device, queries_, 0, 2, sizeof(stamps), stamps.data(), sizeof(stamps[0]),
                              VK_QUERY_RESULT_64_BIT) != VK_SUCCESS)
        return {};
    return static_cast<double>(stamps[1] - stamps[0]) * static_cast<double>(device_.timestampPeriodNs) * 1e-6;
}

}  // namespace stipple::gpu
