#include "engine/gpu/frame_slot.h"

#include <cstring>

namespace stipple::gpu {

using shared::kExtraBinding;
using shared::kExtraFloats;
using shared::kImageBinding;

Result<std::unique_ptr<FrameSlot>> FrameSlot::create(const Device& device, Pipelines& pipelines, Copies& copies) {
    STIPPLE_ASSIGN(const VkDescriptorSet set, pipelines.makeSet());
    std::unique_ptr<FrameSlot> slot(new FrameSlot(device, pipelines, copies, set));
    STIPPLE_TRY(slot->createCommandObjects());
    STIPPLE_ASSIGN(slot->upload_, Upload::create(device, copies));
    return slot;
}

FrameSlot::~FrameSlot() {
    if (isInFlight_) vkWaitForFences(device_.device, 1, &fence_, VK_TRUE, ~uint64_t{0});
    vkDestroyQueryPool(device_.device, queries_, nullptr);
    vkDestroyFence(device_.device, fence_, nullptr);
    vkDestroyCommandPool(device_.device, commandPool_, nullptr);
}

Result<void> FrameSlot::createCommandObjects() {
    STIPPLE_ASSIGN(commandPool_, makeCommandPool(device_, device_.queueFamily));
    STIPPLE_ASSIGN(commands_, makeCommands(device_, commandPool_));
    STIPPLE_ASSIGN(fence_, makeFence(device_));
    STIPPLE_ASSIGN(queries_, makeTimestamps(device_, PassList::kMaxPasses * 2));
    return {};
}

Result<void> FrameSlot::submit(const render::RenderRequest& request, const Residents& residents, Staging& uploads,
                               uint64_t number) {
    hasPicture_ = false;
    STIPPLE_TRY(buffers_.prepare(request, residents));
    STIPPLE_TRY(record(request));
    STIPPLE_TRY(upload_->submit(uploads));
    STIPPLE_TRY(submitCommands(device_.queue, commands_, copies_.sent(), {}, fence_));
    isInFlight_ = true;
    hasPicture_ = true;
    number_ = number;
    return {};
}

Result<void> FrameSlot::record(const render::RenderRequest& request) {
    VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    if (const VkResult r = vkBeginCommandBuffer(commands_, &info); r != VK_SUCCESS)
        return vulkanError(r, "cannot record");
    vkResetQueryPool(device_.device, queries_, 0, PassList::kMaxPasses * 2);
    pipelines_.bind(commands_, set_);
    PassList list(device_, commands_, queries_);
    extraFloats_ = extraFloatsOf(request);
    if (staysOnDevice_) list.wasCopied(buffers_.at(kImageBinding).handle());  // a window may be about it still
    staysOnDevice_ = request.staysOnDevice;
    STIPPLE_TRY(Recording(list, pipelines_, commands_, buffers_, request).recordPasses());
    if (!staysOnDevice_) recordReadback(list);
    if (const VkResult r = vkEndCommandBuffer(commands_); r != VK_SUCCESS)
        return vulkanError(r, "cannot end recording");
    labels_ = list.names();
    return {};
}

void FrameSlot::recordReadback(PassList& list) {
    const uint64_t pixels = uint64_t{buffers_.levels()[0].width} * buffers_.levels()[0].height;
    const VkBuffer image = buffers_.at(kImageBinding).handle(), extra = buffers_.at(kExtraBinding).handle(),
                   to = buffers_.readback().handle();
    list.begin("readback", {{image, false}, {extra, false}, {to, true}}, true);
    VkBufferCopy region{0, 0, bytesOf(kImageBinding, pixels)};
    vkCmdCopyBuffer(commands_, image, to, 1, &region);
    if (extraFloats_ > 0) {
        region = {0, region.size, bytesOf(kExtraBinding, pixels * extraFloats_)};
        vkCmdCopyBuffer(commands_, extra, to, 1, &region);
    }
    list.end();
    list.toHost(to);
}

bool FrameSlot::isDone() const { return !isInFlight_ || vkGetFenceStatus(device_.device, fence_) == VK_SUCCESS; }

Result<void> FrameSlot::wait() {
    if (!isInFlight_) return {};
    if (const VkResult r = vkWaitForFences(device_.device, 1, &fence_, VK_TRUE, ~uint64_t{0}); r != VK_SUCCESS)
        return vulkanError(r, "the device was lost");
    vkResetFences(device_.device, 1, &fence_);
    isInFlight_ = false;
    return {};
}

Result<void> FrameSlot::finish(std::vector<render::PassTime>& times) {
    STIPPLE_TRY(wait());
    takeTimes(times);
    return {};
}

Result<void> FrameSlot::read(render::Image& image, std::vector<render::PassTime>& times) {
    STIPPLE_TRY(wait());
    takeTimes(times);
    takeImage(image);
    hasPicture_ = false;
    return {};
}

void FrameSlot::takeTimes(std::vector<render::PassTime>& times) const {
    std::vector<uint64_t> stamps(labels_.size() * 2);
    times.clear();
    if (const std::optional<double> ms = upload_->milliseconds())
        times.push_back({"upload", *ms, device_.copyFamily != device_.queueFamily});
    if (stamps.empty() ||
        vkGetQueryPoolResults(device_.device, queries_, 0, static_cast<uint32_t>(stamps.size()), stamps.size() * 8,
                              stamps.data(), 8, VK_QUERY_RESULT_64_BIT) != VK_SUCCESS)
        return;
    for (size_t i = 0; i < labels_.size(); ++i) {
        const double ms = static_cast<double>(stamps[2 * i + 1] - stamps[2 * i]) *
                          static_cast<double>(device_.timestampPeriodNs) * 1e-6;
        if (!times.empty() && times.back().name == labels_[i])
            times.back().ms += ms;  // the levels of pull and push
        else
            times.push_back({labels_[i], ms});
    }
}

void FrameSlot::takeImage(render::Image& image) const {
    image.width = buffers_.levels()[0].width;
    image.height = buffers_.levels()[0].height;
    const size_t pixels = size_t{image.width} * image.height;
    image.rgba.resize(pixels);
    std::memcpy(image.rgba.data(), buffers_.readback().mapped(), pixels * 4);
    const auto* from = reinterpret_cast<const float*>(static_cast<const char*>(buffers_.readback().mapped()) +
                                                      bytesOf(kImageBinding, pixels));
    const auto take = [&](std::vector<float>& plane, bool isThere, size_t floats) {
        plane.resize(isThere ? floats : 0);
        if (isThere) std::memcpy(plane.data(), from, floats * sizeof(float));
        from += floats;
    };
    take(image.depth, extraFloats_ > 0, pixels);
    take(image.normal, extraFloats_ == kExtraFloats, 3 * pixels);
    take(image.linear, extraFloats_ == kExtraFloats, 3 * pixels);
}

}  // namespace stipple::gpu
