#include "engine/gpu/pass_list.h"

#include "engine/base/check.h"

namespace stipple::gpu {

void PassList::begin(const std::string& name, const std::vector<BufferUse>& uses, bool isTransfer) {
    const VkPipelineStageFlags2 stageOfPass =
        isTransfer ? VK_PIPELINE_STAGE_2_TRANSFER_BIT : VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
    std::vector<VkBufferMemoryBarrier2> barriers;
    for (const BufferUse& use : uses) {
        VkAccessFlags2 access = isTransfer
                                    ? (use.writes ? VK_ACCESS_2_TRANSFER_WRITE_BIT : VK_ACCESS_2_TRANSFER_READ_BIT)
                                    : VK_ACCESS_2_SHADER_STORAGE_READ_BIT;
        if (!isTransfer && use.writes) access |= VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT;
        if (use.isIndirect) access = VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT;
        const VkPipelineStageFlags2 stage = use.isIndirect ? VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT : stageOfPass;
        Last& last = last_[use.buffer];
        if (use.writes) {
            // (What has been read was waited for, and is past.)
            const BufferTouch before =
                last.reads.stage != 0 ? BufferTouch{last.reads.stage, VK_ACCESS_2_NONE} : last.write;
            if (before.stage != 0) barriers.push_back(bufferBarrier(use.buffer, before, {stage, access}));
            last = {{stage, access}, {}};
        } else {
            const bool isVisible = (stage & ~last.reads.stage) == 0 && (access & ~last.reads.access) == 0;
            if (last.write.stage != 0 && !isVisible)
                barriers.push_back(bufferBarrier(use.buffer, last.write, {stage, access}));
            last.reads.stage |= stage;
            last.reads.access |= access;
        }
    }
    recordBarriers(commands_, barriers);
    STIPPLE_CHECK(names_.size() < kMaxPasses, "a frame has more passes than it has queries for their times");
    stamp(static_cast<uint32_t>(names_.size()) * 2);
    names_.push_back(name);
}

void PassList::wasCopied(VkBuffer buffer) {
    last_[buffer].reads = {VK_PIPELINE_STAGE_2_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_READ_BIT};
}

void PassList::end() { stamp(static_cast<uint32_t>(names_.size()) * 2 - 1); }

void PassList::stamp(uint32_t query) {
    if (!device_.hasTimestamps) return;  // the queries then stay without result, and the passes without times
    vkCmdWriteTimestamp2(commands_, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, queries_, query);
}

void PassList::toHost(VkBuffer buffer) {
    const auto copied = bufferBarrier(buffer, {VK_PIPELINE_STAGE_2_TRANSFER_BIT, VK_ACCESS_2_TRANSFER_WRITE_BIT},
                                      {VK_PIPELINE_STAGE_2_HOST_BIT, VK_ACCESS_2_HOST_READ_BIT});
    recordBarriers(commands_, {&copied, 1});
}

}  // namespace stipple::gpu
