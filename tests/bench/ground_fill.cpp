#include "tests/bench/ground_fill.h"

#include <cstring>

#include "engine/gpu/shader_table.h"

namespace stipple::gpu {
namespace {

#include "test_shaders.inc"

uint32_t low(VkDeviceAddress address) { return static_cast<uint32_t>(address); }
uint32_t high(VkDeviceAddress address) { return static_cast<uint32_t>(address >> 32); }

}  // namespace

Result<std::unique_ptr<GroundFill>> GroundFill::create(const Device& device) {
    std::unique_ptr<GroundFill> f(new GroundFill(device));
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(shared::GroundStep)};
    VkPipelineLayoutCreateInfo layout{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    layout.pushConstantRangeCount = 1;
    layout.pPushConstantRanges = &range;
    if (const VkResult r = vkCreatePipelineLayout(device.device, &layout, nullptr, &f->layout_); r != VK_SUCCESS)
        return vulkanError(r, "no pipeline layout");
    VkShaderModuleCreateInfo code{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    code.codeSize = sizeof(kCode_ground);
    code.pCode = static_cast<const uint32_t*>(kCode_ground);
    VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.pName = "main";
    info.layout = f->layout_;
    if (const VkResult r = vkCreateShaderModule(device.device, &code, nullptr, &info.stage.module); r != VK_SUCCESS)
        return vulkanError(r, "no shader ground");
    const VkResult made = vkCreateComputePipelines(device.device, VK_NULL_HANDLE, 1, &info, nullptr, &f->pipeline_);
    vkDestroyShaderModule(device.device, info.stage.module, nullptr);
    if (made != VK_SUCCESS) return vulkanError(made, "no pipeline ground");
    STIPPLE_ASSIGN(f->pool_, makeCommandPool(device, device.queueFamily));
    STIPPLE_ASSIGN(f->commands_, makeCommands(device, f->pool_));
    STIPPLE_ASSIGN(f->fence_, makeFence(device));
    return f;
}

GroundFill::~GroundFill() {
    vkDestroyFence(device_.device, fence_, nullptr);
    vkDestroyCommandPool(device_.device, pool_, nullptr);
    vkDestroyPipeline(device_.device, pipeline_, nullptr);
    vkDestroyPipelineLayout(device_.device, layout_, nullptr);
}

Result<void> GroundFill::run(std::span<const shared::GroundStep> steps) {
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    if (const VkResult r = vkBeginCommandBuffer(commands_, &begin); r != VK_SUCCESS)
        return vulkanError(r, "cannot record");
    vkCmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
    for (const shared::GroundStep& step : steps) {
        vkCmdPushConstants(commands_, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(step), &step);
        vkCmdDispatch(commands_, (step.count + shared::kGroundThreads - 1) / shared::kGroundThreads, 1, 1);
    }
    // For frames that come, and for the host.
    VkMemoryBarrier2 memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER_2};
    memory.srcStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
    memory.srcAccessMask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
    memory.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_2_HOST_BIT;
    memory.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT | VK_ACCESS_2_HOST_READ_BIT;
    recordBarriers(commands_, {}, &memory);
    if (const VkResult r = vkEndCommandBuffer(commands_); r != VK_SUCCESS)
        return vulkanError(r, "cannot end recording");
    STIPPLE_TRY(submitCommands(device_, commands_, fence_));
    if (const VkResult r = vkWaitForFences(device_.device, 1, &fence_, VK_TRUE, ~uint64_t{0}); r != VK_SUCCESS)
        return vulkanError(r, "the device was lost");
    vkResetFences(device_.device, 1, &fence_);
    return {};
}

Result<void> GroundFill::fill(std::span<const GroundTile> tiles, uint32_t count, uint32_t radiusCode) {
    std::vector<shared::GroundStep> steps;
    for (const GroundTile& t : tiles)
        steps.push_back({low(t.address), high(t.address), 0, 0, t.number, radiusCode, count, 1});
    return run(steps);
}

Result<uint64_t> GroundFill::differing(std::span<const GroundTile> tiles, uint32_t count, uint32_t radiusCode,
                                       uint32_t samples) {
    constexpr uint64_t kBytes = sizeof(shared::PointRecord);
    STIPPLE_ASSIGN(const Buffer copies,
                   Buffer::create(device_, tiles.size() * samples * kBytes,
                                  VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                                  Memory::host, "sampled records"));
    std::vector<shared::GroundStep> steps;
    for (const GroundTile& t : tiles) {
        const VkDeviceAddress to = copies.address() + steps.size() * samples * kBytes;
        steps.push_back(
            {low(t.address), high(t.address), low(to), high(to), t.number, radiusCode, samples, count / samples});
    }
    STIPPLE_TRY(run(steps));
    const auto* got = static_cast<const shared::PointRecord*>(copies.mapped());
    uint64_t differing = 0;
    for (const shared::GroundStep& s : steps)
        for (uint32_t k = 0; k < samples; ++k, ++got) {
            const shared::PointRecord made = shared::groundRecord(s.tile, shared::groundSampled(s, k), radiusCode);
            differing += std::memcmp(got, &made, kBytes) != 0 ? 1 : 0;
        }
    return differing;
}

}  // namespace stipple::gpu
