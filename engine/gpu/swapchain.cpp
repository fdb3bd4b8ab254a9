#include "engine/gpu/swapchain.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

namespace stipple::gpu {
namespace {

constexpr VkFormat kCanvasFormat = VK_FORMAT_R8G8B8A8_UNORM;

VkImageMemoryBarrier2 imageBarrier(VkImage image, VkImageLayout from, VkImageLayout to, VkPipelineStageFlags2 srcStage,
                                   VkAccessFlags2 srcAccess, VkPipelineStageFlags2 dstStage, VkAccessFlags2 dstAccess) {
    VkImageMemoryBarrier2 b{VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2};
    b.srcStageMask = srcStage;
    b.srcAccessMask = srcAccess;
    b.dstStageMask = dstStage;
    b.dstAccessMask = dstAccess;
    b.oldLayout = from;
    b.newLayout = to;
    b.srcQueueFamilyIndex = b.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    b.image = image;
    b.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    return b;
}

void recordBarrier(VkCommandBuffer commands, const VkImageMemoryBarrier2& b) {
    VkDependencyInfo info{VK_STRUCTURE_TYPE_DEPENDENCY_INFO};
    info.imageMemoryBarrierCount = 1;
    info.pImageMemoryBarriers = &b;
    vkCmdPipelineBarrier2(commands, &info);
}

}  // namespace

Result<std::unique_ptr<Swapchain>> Swapchain::create(const Device& device, VkSurfaceKHR surface) {
    std::unique_ptr<Swapchain> s(new Swapchain(device, surface));
    VkBool32 supported = VK_FALSE;
    vkGetPhysicalDeviceSurfaceSupportKHR(device.physical, device.queueFamily, surface, &supported);
    if (!supported)
        return fail(ErrorKind::device, "cannot present to this display", device.deviceName, "use stipple render");
    STIPPLE_ASSIGN(s->pool_, makeCommandPool(device, device.queueFamily));
    STIPPLE_ASSIGN(s->commands_, makeCommands(device, s->pool_));
    STIPPLE_ASSIGN(s->fence_, makeFence(device));
    VkSemaphoreCreateInfo semaphore{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO};
    if (const VkResult r = vkCreateSemaphore(device.device, &semaphore, nullptr, &s->acquired_); r != VK_SUCCESS)
        return vulkanError(r, "no semaphore");
    STIPPLE_TRY(s->createRenderPass());
    return s;
}

Swapchain::~Swapchain() {
    vkDeviceWaitIdle(device_.device);
    destroyCanvas();
    vkDestroyRenderPass(device_.device, renderPass_, nullptr);
    for (VkSemaphore s : rendered_) vkDestroySemaphore(device_.device, s, nullptr);
    vkDestroySemaphore(device_.device, acquired_, nullptr);
    vkDestroyFence(device_.device, fence_, nullptr);
    vkDestroyCommandPool(device_.device, pool_, nullptr);
    if (swapchain_ != VK_NULL_HANDLE) vkDestroySwapchainKHR(device_.device, swapchain_, nullptr);
}

Result<void> Swapchain::createRenderPass() {
    VkAttachmentDescription colour{};
    colour.format = kCanvasFormat;
    colour.samples = VK_SAMPLE_COUNT_1_BIT;
    colour.loadOp = VK_ATTACHMENT_LOAD_OP_LOAD;
    colour.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    colour.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
    colour.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
    colour.initialLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    colour.finalLayout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
    const VkAttachmentReference reference{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
    VkSubpassDescription subpass{};
    subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    subpass.colorAttachmentCount = 1;
    subpass.pColorAttachments = &reference;
    VkRenderPassCreateInfo info{VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO};
    info.attachmentCount = 1;
    info.pAttachments = &colour;
    info.subpassCount = 1;
    info.pSubpasses = &subpass;
    if (const VkResult r = vkCreateRenderPass(device_.device, &info, nullptr, &renderPass_); r != VK_SUCCESS)
        return vulkanError(r, "no render pass");
    return {};
}

void Swapchain::destroyCanvas() {
    vkDestroyFramebuffer(device_.device, framebuffer_, nullptr);
    vkDestroyImageView(device_.device, canvasView_, nullptr);
    vkDestroyImage(device_.device, canvas_, nullptr);
    vkFreeMemory(device_.device, canvasMemory_, nullptr);
    framebuffer_ = VK_NULL_HANDLE;
    canvasView_ = VK_NULL_HANDLE;
    canvas_ = VK_NULL_HANDLE;
    canvasMemory_ = VK_NULL_HANDLE;
}

Result<void> Swapchain::createCanvas(uint32_t width, uint32_t height) {
    destroyCanvas();
    VkImageCreateInfo info{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO};
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = kCanvasFormat;
    info.extent = {width, height, 1};
    info.mipLevels = info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.tiling = VK_IMAGE_TILING_OPTIMAL;
    info.usage =
        VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
    if (const VkResult r = vkCreateImage(device_.device, &info, nullptr, &canvas_); r != VK_SUCCESS)
        return vulkanError(r, "no canvas");
    VkMemoryRequirements needs{};
    vkGetImageMemoryRequirements(device_.device, canvas_, &needs);
    STIPPLE_ASSIGN(canvasMemory_, allocateMemory(device_, needs, Memory::device, false, "the canvas"));
    if (const VkResult r = vkBindImageMemory(device_.device, canvas_, canvasMemory_, 0); r != VK_SUCCESS)
        return vulkanError(r, "cannot bind the canvas");
    VkImageViewCreateInfo view{VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO};
    view.image = canvas_;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = kCanvasFormat;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    if (const VkResult r = vkCreateImageView(device_.device, &view, nullptr, &canvasView_); r != VK_SUCCESS)
        return vulkanError(r, "no canvas view");
    VkFramebufferCreateInfo frame{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO};
    frame.renderPass = renderPass_;
    frame.attachmentCount = 1;
    frame.pAttachments = &canvasView_;
    frame.width = width;
    frame.height = height;
    frame.layers = 1;
    if (const VkResult r = vkCreateFramebuffer(device_.device, &frame, nullptr, &framebuffer_); r != VK_SUCCESS)
        return vulkanError(r, "no framebuffer");
    const uint64_t bytes = uint64_t{width} * height * 4;
    STIPPLE_ASSIGN(staging_,
                   Buffer::create(device_, bytes, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Memory::host, "window staging"));
    STIPPLE_ASSIGN(readback_,
                   Buffer::create(device_, bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Memory::host, "screenshot"));
    canvasWidth_ = width;
    canvasHeight_ = height;
    return {};
}

Result<void> Swapchain::resize(uint32_t width, uint32_t height) {
    vkDeviceWaitIdle(device_.device);
    VkSurfaceCapabilitiesKHR caps{};
    vkGetPhysicalDeviceSurfaceCapabilitiesKHR(device_.physical, surface_, &caps);
    extent_ = caps.currentExtent.width != ~0u ? caps.currentExtent : VkExtent2D{width, height};
    if (extent_.width == 0 || extent_.height == 0) return {};  // minimised
    uint32_t formats = 0;
    vkGetPhysicalDeviceSurfaceFormatsKHR(device_.physical, surface_, &formats, nullptr);
    std::vector<VkSurfaceFormatKHR> format(formats);
    vkGetPhysicalDeviceSurfaceFormatsKHR(device_.physical, surface_, &formats, format.data());
    // The canvas holds sRGB bytes already: an UNORM format shows them as they are.
    const auto chosen = std::find_if(format.begin(), format.end(), [](const VkSurfaceFormatKHR& f) {
        return f.format == VK_FORMAT_B8G8R8A8_UNORM || f.format == VK_FORMAT_R8G8B8A8_UNORM;
    });
    if (chosen == format.end())
        return fail(ErrorKind::device, "offers no 8-bit RGBA window", device_.deviceName, "use stipple render");
    VkSwapchainCreateInfoKHR info{VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR};
    info.surface = surface_;
    info.minImageCount =
        caps.maxImageCount > 0 ? std::min(caps.minImageCount + 1, caps.maxImageCount) : caps.minImageCount + 1;
    info.imageFormat = chosen->format;
    info.imageColorSpace = chosen->colorSpace;
    info.imageExtent = extent_;
    info.imageArrayLayers = 1;
    info.imageUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    info.preTransform = caps.currentTransform;
    info.compositeAlpha = (caps.supportedCompositeAlpha & VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR) != 0
                              ? VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR
                              : VK_COMPOSITE_ALPHA_INHERIT_BIT_KHR;
    info.presentMode = VK_PRESENT_MODE_FIFO_KHR;
    info.clipped = VK_TRUE;
    info.oldSwapchain = swapchain_;
    VkSwapchainKHR made = VK_NULL_HANDLE;
    if (const VkResult r = vkCreateSwapchainKHR(device_.device, &info, nullptr, &made); r != VK_SUCCESS)
        return vulkanError(r, "no swapchain");
    if (swapchain_ != VK_NULL_HANDLE) vkDestroySwapchainKHR(device_.device, swapchain_, nullptr);
    swapchain_ = made;
    uint32_t count = 0;
    vkGetSwapchainImagesKHR(device_.device, swapchain_, &count, nullptr);
    images_.resize(count);
    vkGetSwapchainImagesKHR(device_.device, swapchain_, &count, images_.data());
    while (rendered_.size() < count) {
        VkSemaphoreCreateInfo semaphore{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO};
        rendered_.push_back(VK_NULL_HANDLE);
        if (const VkResult r = vkCreateSemaphore(device_.device, &semaphore, nullptr, &rendered_.back());
            r != VK_SUCCESS)
            return vulkanError(r, "no semaphore");
    }
    return {};
}

Result<void> Swapchain::begin() {
    VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    if (const VkResult r = vkBeginCommandBuffer(commands_, &info); r != VK_SUCCESS)
        return vulkanError(r, "cannot record");
    return {};
}

Result<void> Swapchain::runOnce(const std::function<void(VkCommandBuffer)>& record) {
    STIPPLE_TRY(waitForLast());
    STIPPLE_TRY(begin());
    record(commands_);
    vkEndCommandBuffer(commands_);
    STIPPLE_TRY(submitCommands(device_, commands_, fence_));
    vkWaitForFences(device_.device, 1, &fence_, VK_TRUE, ~uint64_t{0});
    vkResetFences(device_.device, 1, &fence_);
    return {};
}

Result<void> Swapchain::waitForLast() {
    if (!std::exchange(isInFlight_, false)) return {};
    if (const VkResult r = vkWaitForFences(device_.device, 1, &fence_, VK_TRUE, ~uint64_t{0}); r != VK_SUCCESS)
        return vulkanError(r, "the device was lost");
    vkResetFences(device_.device, 1, &fence_);
    return {};
}

/// Into the canvas.
void Swapchain::recordPixels(const ShownPixels& pixels) {
    const auto transfer = VK_PIPELINE_STAGE_2_TRANSFER_BIT;
    if (pixels.device != VK_NULL_HANDLE) {
        const auto drawn =
            bufferBarrier(pixels.device, {VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT},
                          {transfer, VK_ACCESS_2_TRANSFER_READ_BIT});
        recordBarriers(commands_, {&drawn, 1});
    }
    recordBarrier(commands_, imageBarrier(canvas_, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                          transfer, 0, transfer, VK_ACCESS_2_TRANSFER_WRITE_BIT));
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.imageExtent = {canvasWidth_, canvasHeight_, 1};
    vkCmdCopyBufferToImage(commands_, pixels.device != VK_NULL_HANDLE ? pixels.device : staging_.handle(), canvas_,
                           VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
}

void Swapchain::recordFrame(const ShownPixels& pixels, const std::function<void(VkCommandBuffer)>& overlay,
                            bool capture, uint32_t imageIndex) {
    const auto transfer = VK_PIPELINE_STAGE_2_TRANSFER_BIT;
    const auto output = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT;
    const VkAccessFlags2 attachment = VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT;
    recordPixels(pixels);
    recordBarrier(commands_,
                  imageBarrier(canvas_, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
                               transfer, VK_ACCESS_2_TRANSFER_WRITE_BIT, output, attachment));
    VkRenderPassBeginInfo begin{VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO};
    begin.renderPass = renderPass_;
    begin.framebuffer = framebuffer_;
    begin.renderArea.extent = {canvasWidth_, canvasHeight_};
    vkCmdBeginRenderPass(commands_, &begin, VK_SUBPASS_CONTENTS_INLINE);
    overlay(commands_);
    vkCmdEndRenderPass(commands_);
    recordBarrier(commands_,
                  imageBarrier(canvas_, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                               output, attachment, transfer, VK_ACCESS_2_TRANSFER_READ_BIT));
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    copy.imageExtent = {canvasWidth_, canvasHeight_, 1};
    if (capture)
        vkCmdCopyImageToBuffer(commands_, canvas_, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, readback_.handle(), 1, &copy);
    VkImage target = images_[imageIndex];
    recordBarrier(commands_, imageBarrier(target, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                                          transfer, 0, transfer, VK_ACCESS_2_TRANSFER_WRITE_BIT));
    VkImageBlit blit{};
    blit.srcSubresource = blit.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    blit.srcOffsets[1] = {static_cast<int32_t>(canvasWidth_), static_cast<int32_t>(canvasHeight_), 1};
    blit.dstOffsets[1] = {static_cast<int32_t>(extent_.width), static_cast<int32_t>(extent_.height), 1};
    vkCmdBlitImage(commands_, canvas_, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, target,
                   VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &blit, VK_FILTER_LINEAR);
    recordBarrier(commands_,
                  imageBarrier(target, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, transfer,
                               VK_ACCESS_2_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_2_BOTTOM_OF_PIPE_BIT, 0));
}

/// VK_SUCCESS, or what submitting or presenting said.
VkResult Swapchain::submitAndShow(uint32_t imageIndex) {
    VkSemaphoreSubmitInfo wait{VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO},
        signal{VK_STRUCTURE_TYPE_SEMAPHORE_SUBMIT_INFO};
    wait.semaphore = acquired_;
    wait.stageMask = VK_PIPELINE_STAGE_2_TRANSFER_BIT;
    signal.semaphore = rendered_[imageIndex];
    signal.stageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    VkCommandBufferSubmitInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
    buffer.commandBuffer = commands_;
    VkSubmitInfo2 info{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
    info.waitSemaphoreInfoCount = info.signalSemaphoreInfoCount = info.commandBufferInfoCount = 1;
    info.pWaitSemaphoreInfos = &wait;
    info.pSignalSemaphoreInfos = &signal;
    info.pCommandBufferInfos = &buffer;
    if (const VkResult r = vkQueueSubmit2(device_.queue, 1, &info, fence_); r != VK_SUCCESS) return r;
    isInFlight_ = true;
    VkPresentInfoKHR present{VK_STRUCTURE_TYPE_PRESENT_INFO_KHR};
    present.waitSemaphoreCount = present.swapchainCount = 1;
    present.pWaitSemaphores = &rendered_[imageIndex];
    present.pSwapchains = &swapchain_;
    present.pImageIndices = &imageIndex;
    return vkQueuePresentKHR(device_.queue, &present);
}

void Swapchain::takeCapture(render::Image& capture) const {
    capture.width = canvasWidth_;
    capture.height = canvasHeight_;
    capture.rgba.resize(size_t{canvasWidth_} * canvasHeight_);
    std::memcpy(capture.rgba.data(), readback_.mapped(), capture.rgba.size() * 4);
    for (uint32_t& p : capture.rgba) p |= 0xff000000u;
}

Result<bool> Swapchain::present(const ShownPixels& pixels, const std::function<void(VkCommandBuffer)>& overlay,
                                render::Image* capture) {
    STIPPLE_TRY(waitForLast());
    // Drivers need not say that the window has another size by now, so it is not left to them.
    if (pixels.width != extent_.width || pixels.height != extent_.height)
        STIPPLE_TRY(resize(pixels.width, pixels.height));
    if (extent_.width == 0 || extent_.height == 0) return false;  // minimised
    if (pixels.width != canvasWidth_ || pixels.height != canvasHeight_)
        STIPPLE_TRY(createCanvas(pixels.width, pixels.height));
    if (pixels.host != nullptr) std::memcpy(staging_.mapped(), pixels.host, size_t{pixels.width} * pixels.height * 4);
    constexpr uint64_t kPatienceNs = 200'000'000;  // a window that is not seen may give no image for ever
    uint32_t index = 0;
    VkResult r = vkAcquireNextImageKHR(device_.device, swapchain_, kPatienceNs, acquired_, VK_NULL_HANDLE, &index);
    if (r == VK_TIMEOUT || r == VK_NOT_READY) return false;
    if (r == VK_ERROR_OUT_OF_DATE_KHR) {
        STIPPLE_TRY(resize(pixels.width, pixels.height));
        return false;
    }
    if (r != VK_SUCCESS && r != VK_SUBOPTIMAL_KHR) return vulkanError(r, "no image from the swapchain");
    STIPPLE_TRY(begin());
    recordFrame(pixels, overlay, capture != nullptr, index);
    vkEndCommandBuffer(commands_);
    r = submitAndShow(index);
    if (capture) {
        STIPPLE_TRY(waitForLast());
        takeCapture(*capture);
    }
    if (r == VK_ERROR_OUT_OF_DATE_KHR || r == VK_SUBOPTIMAL_KHR) {
        STIPPLE_TRY(resize(pixels.width, pixels.height));
        return r == VK_SUBOPTIMAL_KHR;
    }
    if (r != VK_SUCCESS) return vulkanError(r, "cannot present");
    return true;
}

}  // namespace stipple::gpu
