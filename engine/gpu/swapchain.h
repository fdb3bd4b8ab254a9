// The swapchain and the picture shown on it: an image of our own that takes the backend's pixels and the overlay, and
// is then copied to the window (so that a screenshot is exactly what was shown).
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "engine/gpu/device.h"
#include "engine/render/backend.h"

namespace stipple::gpu {

/// What is to be shown: pixels of the host, or a buffer of this device that compute shaders have written.
struct ShownPixels {
    const uint32_t* host = nullptr;
    VkBuffer device = VK_NULL_HANDLE;
    uint32_t width = 0, height = 0;
};

class Swapchain {
  public:
    static Result<std::unique_ptr<Swapchain>> create(const Device& device, VkSurfaceKHR surface);
    ~Swapchain();
    Swapchain(const Swapchain&) = delete;
    Swapchain& operator=(const Swapchain&) = delete;
    Result<void> resize(uint32_t width, uint32_t height);
    VkRenderPass renderPass() const { return renderPass_; }
    /// A swapchain of another size than the image is made anew first. False if it could not be shown now. It does not
    /// wait for the device, but the next one waits for this.
    Result<bool> present(const ShownPixels& pixels, const std::function<void(VkCommandBuffer)>& overlay,
                         render::Image* capture);
    /// Records and runs commands at once.
    Result<void> runOnce(const std::function<void(VkCommandBuffer)>& record);

  private:
    explicit Swapchain(const Device& device, VkSurfaceKHR surface) : device_(device), surface_(surface) {}
    Result<void> createCanvas(uint32_t width, uint32_t height);
    void destroyCanvas();
    Result<void> createRenderPass();
    void recordFrame(const ShownPixels& pixels, const std::function<void(VkCommandBuffer)>& overlay, bool capture,
                     uint32_t imageIndex);
    void recordPixels(const ShownPixels& pixels);
    Result<void> waitForLast();
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
    bool isInFlight_ = false;
    VkSemaphore acquired_ = VK_NULL_HANDLE;
};

}  // namespace stipple::gpu
