// A frame in flight: its buffers, its commands, and what it leaves.
#pragma once

#include <memory>
#include <vector>

#include "engine/gpu/frame_buffers.h"
#include "engine/gpu/record.h"
#include "engine/gpu/upload.h"

namespace stipple::gpu {

class FrameSlot {
  public:
    static Result<std::unique_ptr<FrameSlot>> create(const Device& device, Pipelines& pipelines, Copies& copies);
    ~FrameSlot();
    FrameSlot(const FrameSlot&) = delete;
    FrameSlot& operator=(const FrameSlot&) = delete;

    /// Records and sends a frame; not while one is in flight. It takes `uploads`, and leaves an empty one.
    Result<void> submit(const render::RenderRequest& request, const Residents& residents, Staging& uploads,
                        uint64_t number);
    /// Has the device finished it?
    bool isDone() const;
    Result<void> wait();
    /// Waits and hands over; once.
    Result<void> read(render::Image& image, std::vector<render::PassTime>& times);

    /// Waits, without handing over.
    Result<void> finish(std::vector<render::PassTime>& times);

    bool isInFlight() const { return isInFlight_; }
    uint64_t number() const { return number_; }            ///< of its last frame
    bool hasPicture() const { return hasPicture_; }        ///< that nobody has read
    bool staysOnDevice() const { return staysOnDevice_; }  ///< nobody can read it
    const FrameBuffers& buffers() const { return buffers_; }

  private:
    FrameSlot(const Device& device, Pipelines& pipelines, Copies& copies, VkDescriptorSet set)
        : device_(device), pipelines_(pipelines), copies_(copies), set_(set), buffers_(device, set) {}
    Result<void> createCommandObjects();
    Result<void> record(const render::RenderRequest& request);
    void recordReadback(PassList& list);
    void takeTimes(std::vector<render::PassTime>& times) const;
    void takeImage(render::Image& image) const;

    const Device& device_;
    Pipelines& pipelines_;
    Copies& copies_;
    VkDescriptorSet set_;
    FrameBuffers buffers_;
    std::unique_ptr<Upload> upload_;  ///< of chunks that the frame is the first to see
    VkCommandPool commandPool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkFence fence_ = VK_NULL_HANDLE;
    VkQueryPool queries_ = VK_NULL_HANDLE;
    std::vector<std::string> labels_;  ///< of the passes that were recorded
    uint64_t number_ = 0;
    bool isInFlight_ = false, hasPicture_ = false, staysOnDevice_ = false;
    uint64_t extraFloats_ = 0;  ///< of a pixel
};

}  // namespace stipple::gpu
