// The swapchain and the picture shown on it: an image of our own that takes the backend's pixels and the overlay, and
// is then copied to the window (so that a screenshot is exactly what was shown).
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "engine/gpu/device.h"
#include "engine/render/backend.h"

namespace stipple::gpu {

class Swapchain {
  public:
    static Result<std::unique_ptr<Swapchain>> create(const Device& device, VkSurfaceKHR surface);
    ~Swapchain();
    Swapchain(const Swapchain&) = delete;
    Swapchain& operator=(const Swapchain&) = delete;
    Result<void> resize(uint32_t width, uint32_t height);
    VkRenderPass renderPass() const { return renderPass_; }
    /// A swapchain of another size than the image is made anew first. False if it could not be shown now.
    Result<bool> present(const render::Image& image, const std::function<void(VkCommandBuffer)>& overlay,
                         render::Image* capture);
    /// Records and runs commands at once.
    Result<void> runOnce(const std::function<void(VkCommandBuffer)>& record);

  private:
    explicit Swapchain(const Device& device, VkSurfaceKHR surface) : device_(device), surface_(surface) {}
    Result<void> createCanvas(uint32_t width, uint32_t height);
    void destroyCanvas();
    Result<void> createRenderPass();
    void recordFrame(const std::function<void(VkCommandBuffer)>& overlay, bool capture, uint32_t imageIndex);
    Result<void> begin();
    VkResult submitAndShow(uint32_t imageIndex);
    void takeCapture(render::Image& capture) const;

    const Device& device_;
    VkSurfaceKHR surface_;
    VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
    std::vector<VkImage> images_;
    std::vector<VkSemaphore> rendered_;  ///< one per swapchain image
    VkExtent2D extent_{};                ///< of the window
    VkRenderPass renderPass_ = VK_NULL_HANDLE;
    VkImage canvas_ = VK_NULL_HANDLE;
    VkDeviceMemory canvasMemory_ = VK_NULL_HANDLE;
    VkImageView canvasView_ = VK_NULL_HANDLE;
    VkFramebuffer framebuffer_ = VK_NULL_HANDLE;
    uint32_t canvasWidth_ = 0, canvasHeight_ = 0;
    Buffer staging_, readback_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkFence fence_ = VK_NULL_HANDLE;
    VkSemaphore acquired_ = VK_NULL_HANDLE;
};

}  // namespace stipple::gpu
